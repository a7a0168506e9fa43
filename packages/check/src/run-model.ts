import type { Contract, OnnxHeader } from '@gaussian-splat/core';
import type { ModelLocation } from './model-location.js';
import { runModel, type RunReport, type Runtime } from './run-samples.js';

/** Runs a model at a path or an address, see {@link runModel}. */
export async function runLocation(location: ModelLocation, header: OnnxHeader, contract: Contract): Promise<RunReport> {
  const externalData = await Promise.all(
    header.externalFiles.map(async ({ location: path }) => ({ path, data: await location.external(path) })),
  );
  return runModel(await loadRuntime(), { bytes: await location.bytes(), externalData }, header, contract);
}

/** Loaded only when a model is to be run: the runtime is large. */
async function loadRuntime(): Promise<Runtime> {
  const ort = await import('onnxruntime-web');
  ort.env.logLevel = 'error';
  ort.env.wasm.numThreads = 1;
  return ort;
}
