/**
 * Utilities for tests of running generators: a device, sinks that read back, the reference from the CPU, and counters.
 */
import { halfToNumber, type Camera } from '@gaussian-splat/core';
import { carriesContract, resolveContract } from '@gaussian-splat/core/contract';
import { bytesSource, readOnnxHeader } from '@gaussian-splat/core/onnx';
import { autotune } from '@gaussian-splat/renderer';
import { bindInputs, setRuntimeLocation, type GaussianSink, type GeneratorState } from '@gaussian-splat/generator';
import type * as OnnxRuntime from 'onnxruntime-web/wasm';

export const FIXTURES = '/tests/fixtures/generators/';
export const RUNTIME = '/node_modules/onnxruntime-web/dist/';

setRuntimeLocation(RUNTIME);

/** A camera in front of the unit ball. */
export const CAMERA: Camera = {
  width: 96,
  height: 64,
  fx: 80,
  fy: 80,
  cx: 48,
  cy: 32,
  near: 0.1,
  far: 100,
  worldToCamera: [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 4, 0, 0, 0, 1],
};

/** A device with those of the optional features that the adapter has. */
export async function makeDevice(optional: readonly GPUFeatureName[] = []): Promise<GPUDevice> {
  const adapter = await navigator.gpu.requestAdapter();
  if (adapter === null) throw new Error('no WebGPU adapter in this browser');
  const { maxStorageBuffersPerShaderStage } = adapter.limits;
  const requiredFeatures = optional.filter((feature) => adapter.features.has(feature));
  const device = await adapter.requestDevice({ requiredFeatures, requiredLimits: { maxStorageBuffersPerShaderStage } });
  // Models run on the software GPU of tests as on hardware.
  const { vendor, architecture, device: model, description, subgroupMinSize, subgroupMaxSize } = device.adapterInfo;
  const info = { vendor, architecture, device: model, description, subgroupMinSize, subgroupMaxSize };
  Object.defineProperty(device, 'adapterInfo', { value: { ...info, isFallbackAdapter: false }, configurable: true });
  // Variants that the element finds on SwiftShader, which takes seconds to compile the rest.
  const choice = JSON.stringify({
    rasterizer: 'quads',
    accumulation: 'rgba16float',
    threads: 'serial',
    sort: 'serial',
  });
  await autotune(device, { store: { getItem: () => choice, setItem: () => undefined } });
  return device;
}

/** Keeps what runs write. */
export class ReadingSink implements GaussianSink {
  readonly runs: { rows: number; tensors: Record<string, Promise<Uint8Array>> }[] = [];
  readonly #device: GPUDevice;

  constructor(device: GPUDevice) {
    this.#device = device;
  }

  ingest(tensors: Readonly<Record<string, GPUBuffer>>, rows: number): void {
    const read = Object.entries(tensors).map(([name, buffer]) => [name, readBuffer(this.#device, buffer)] as const);
    this.runs.push({ rows, tensors: Object.fromEntries(read) });
  }
}

/** All bytes of a buffer as they are now. */
export function readBuffer(device: GPUDevice, buffer: GPUBuffer): Promise<Uint8Array> {
  const staging = device.createBuffer({ size: buffer.size, usage: 0x1 | 0x8 });
  const encoder = device.createCommandEncoder();
  encoder.copyBufferToBuffer(buffer, 0, staging, 0, buffer.size);
  device.queue.submit([encoder.finish()]);
  return staging.mapAsync(0x1).then(() => {
    const bytes = new Uint8Array(staging.getMappedRange().slice(0));
    staging.destroy();
    return bytes;
  });
}

/** The code of the error that a promise rejects with. */
export async function codeOf(promise: Promise<unknown>): Promise<string> {
  try {
    await promise;
  } catch (error) {
    return (error as { code?: string }).code ?? String(error);
  }
  return 'none';
}

let ort: Promise<typeof OnnxRuntime> | undefined;

/** Another copy of the runtime, whose only provider is the CPU. */
function cpuRuntime(): Promise<typeof OnnxRuntime> {
  const script = `${RUNTIME}ort.wasm.bundle.min.mjs`;
  ort ??= import(script).then((module: typeof OnnxRuntime) => {
    module.env.wasm.numThreads = 1;
    module.env.wasm.wasmPaths = { wasm: `${RUNTIME}ort-wasm-simd-threaded.wasm` };
    return module;
  });
  return ort;
}

/** Numbers of every output of a model on the CPU. */
export async function runOnCpu(
  url: string,
  state: GeneratorState,
  images: Readonly<Record<string, { dims: readonly number[]; data: Float32Array }>> = {},
): Promise<Record<string, { dims: readonly number[]; values: number[] }>> {
  const { InferenceSession, Tensor } = await cpuRuntime();
  const bytes = new Uint8Array(await (await fetch(url)).arrayBuffer());
  const header = await readOnnxHeader(bytesSource(bytes, url));
  const beside = carriesContract(header) ? undefined : await fetch(url.replace(/\.onnx$/, '.contract.json'));
  const { contract } = resolveContract({ header, sidecar: beside?.ok ? await beside.text() : undefined });
  const externalData = await Promise.all(
    header.externalFiles.map(async ({ location: path }) => {
      const response = await fetch(new URL(path, new URL(url, location.href)));
      return { path, data: new Uint8Array(await response.arrayBuffer()) };
    }),
  );
  const session = await InferenceSession.create(bytes, { executionProviders: ['wasm'], externalData });
  const feeds = Object.entries(bindInputs(header, contract, state)).map(
    ([name, { dtype, data, dims }]) => [name, new Tensor(dtype, data as never, dims)] as const,
  );
  for (const [name, { dims, data }] of Object.entries(images)) feeds.push([name, new Tensor('float32', data, dims)]);
  const results = await session.run(Object.fromEntries(feeds));
  await session.release();
  return Object.fromEntries(
    Object.entries(results).map(([name, { dims, data, type }]) => [name, { dims, values: numbersOf(data, type) }]),
  );
}

/** Numbers of a tensor's bytes or of its array. */
export function numbersOf(data: unknown, type: string): number[] {
  const { buffer, byteOffset, byteLength } = data as Uint8Array<ArrayBuffer>;
  const bytes = buffer.slice(byteOffset, byteOffset + byteLength);
  if (type === 'float16') return Array.from(new Uint16Array(bytes), halfToNumber);
  return Array.from(type === 'int32' ? new Int32Array(bytes) : new Float32Array(bytes));
}

/** Largest difference as a fraction of the largest magnitude. */
export function relativeError(found: readonly number[], expected: readonly number[]): number {
  const scale = expected.reduce((max, x) => Math.max(max, Math.abs(x)), 1e-12);
  return expected.reduce((worst, x, i) => Math.max(worst, Math.abs(x - found[i]) / scale), 0);
}

/** Calls since the page was opened, for tests that a frame omits them. */
export const calls = {
  ...{ createBuffer: 0, mapAsync: 0, createBindGroup: 0 },
  ...{ createComputePipeline: 0, createComputePipelineAsync: 0 },
};

const COUNTED = ['createBuffer', 'createBindGroup', 'createComputePipeline', 'createComputePipelineAsync'] as const;
for (const name of COUNTED) {
  const original = GPUDevice.prototype[name] as (this: GPUDevice, argument: never) => unknown;
  Object.assign(GPUDevice.prototype, {
    [name](this: GPUDevice, argument: never) {
      calls[name]++;
      return original.call(this, argument);
    },
  });
}
/** Compute dispatches since the page was opened. */
export const dispatches = { count: 0 };

const { dispatchWorkgroups } = GPUComputePassEncoder.prototype;
GPUComputePassEncoder.prototype.dispatchWorkgroups = function countingDispatches(this: GPUComputePassEncoder, ...size) {
  dispatches.count++;
  return dispatchWorkgroups.apply(this, size);
};
const mapAsync = GPUBuffer.prototype.mapAsync;
GPUBuffer.prototype.mapAsync = function countingMapAsync(this: GPUBuffer, ...rest) {
  calls.mapAsync++;
  return mapAsync.apply(this, rest);
};
