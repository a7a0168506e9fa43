import { GaussianSplatError, loadModule } from '@gaussian-splat/core';
import {
  carriesContract,
  checkContract,
  checkFile,
  ContractError,
  contractReport,
  resolveContract,
  type Contract,
  type ContractFault,
  type ReportSection,
  type ResolvedContract,
} from '@gaussian-splat/core/contract';
import { readOnnxHeader, type OnnxHeader } from '@gaussian-splat/core/onnx';
import { openModel, readText, type ModelLocation } from './model-location.js';
import { runModel, type RunReport, type Runtime } from './run-samples.js';

export interface CheckOptions {
  /** Path or URL of a contract, which takes precedence over all others. */
  readonly contract?: string;
  /** Whether the model is also run and its values checked. Default false. */
  readonly run?: boolean;
}

/** A fault of the contract, or an error that prevented the check. */
export type CheckFault = ContractFault | GaussianSplatError;

export interface CheckReport {
  readonly sections: readonly ReportSection[];
  readonly faults: readonly CheckFault[];
  /** The contract; undefined without a valid one. */
  readonly contract?: Contract | undefined;
  /** Assumptions that were made because the model has no contract. */
  readonly warnings: readonly string[];
}

/**
 * Checks one model against its contract.
 * @param model Path or URL of an ONNX file.
 * @returns Tables for display, and every fault. Rejects only for programming errors.
 */
export async function checkModel(model: string, options: CheckOptions = {}): Promise<CheckReport> {
  let location: ModelLocation | undefined;
  try {
    location = await openModel(model);
    return await checkLocation(location, options);
  } catch (error) {
    if (!(error instanceof GaussianSplatError)) throw error;
    return { sections: [], faults: [error], warnings: [] };
  } finally {
    await location?.close();
  }
}

async function checkLocation(location: ModelLocation, options: CheckOptions): Promise<CheckReport> {
  const header = await readOnnxHeader(location.source);
  const { resolved, faults: contractFaults } = await contractOf(location, header, options);
  const files = await location.externalSizes(header.externalFiles);
  const headerFaults = resolved
    ? checkContract(header, resolved.contract, { files })
    : [...checkFile(header, { files }), ...contractFaults];
  const sections = contractReport(header, resolved);
  const warnings = resolved?.notes ?? [];
  const contract = resolved?.contract;
  if (!options.run || !contract || headerFaults.length > 0)
    return { sections, faults: headerFaults, warnings, contract };
  const { faults, rows } = await runLocation(location, header, contract);
  return { sections: rows.length > 0 ? [...sections, { title: 'Runs', rows }] : sections, faults, warnings, contract };
}

/** Returns the contract, or its faults if it is missing or invalid. */
async function contractOf(
  location: ModelLocation,
  header: OnnxHeader,
  { contract }: CheckOptions,
): Promise<{ resolved?: ResolvedContract; faults: readonly ContractFault[] }> {
  const explicit = contract === undefined ? undefined : await readText(contract);
  const isAsked = explicit === undefined && !carriesContract(header);
  const sidecar = isAsked ? await location.sidecar() : undefined;
  try {
    return { resolved: resolveContract({ header, explicit, sidecar }), faults: [] };
  } catch (error) {
    if (error instanceof ContractError) return { faults: error.faults };
    throw error;
  }
}

/** Runs a model at a path or URL: see {@link runModel}. */
async function runLocation(location: ModelLocation, header: OnnxHeader, contract: Contract): Promise<RunReport> {
  const externalData = await Promise.all(
    header.externalFiles.map(async ({ location: path }) => ({ path, data: await location.external(path) })),
  );
  return runModel(await loadRuntime(), { bytes: await location.bytes(), externalData }, header, contract);
}

/** Loads ONNX Runtime for the CPU, only if a model is run, because it is large. */
async function loadRuntime(): Promise<Runtime> {
  const ort = await loadModule('ONNX Runtime', () => import('onnxruntime-web'));
  ort.env.logLevel = 'error';
  ort.env.wasm.numThreads = 1;
  return ort;
}
