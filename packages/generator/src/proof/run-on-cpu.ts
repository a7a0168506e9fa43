import type { RuntimeSource } from '../runtime/load-runtime.js';

/** A run of a model, with everything that a worker needs. */
export interface CpuRun {
  readonly model: Uint8Array;
  readonly externalData: readonly { readonly path: string; readonly data: Uint8Array }[];
  readonly freeDimensionOverrides: Readonly<Record<string, number>> | undefined;
  readonly feeds: Readonly<
    Record<string, { readonly dtype: string; readonly dims: readonly number[]; readonly data: ArrayBufferView }>
  >;
  /** Pieces of outputs that are wanted, in bytes. */
  readonly parts: readonly { readonly tensor: string; readonly offset: number; readonly size: number }[];
}

export interface CpuOutputs {
  readonly dims: Readonly<Record<string, readonly number[]>>;
  /** As they were asked for. */
  readonly parts: readonly Uint8Array[];
}

/** Longest that a run may take, start of the runtime included, ms. */
const LIMIT_MS = 60_000;

/**
 * The worker's whole script. A string, since it is a worker of any page's own origin that imports the runtime from wherever that is; bundlers
 * need not know of it.
 */
const SCRIPT = `onmessage = async ({ data: { script, wasm, run } }) => {
  try {
    const ort = await import(script);
    ort.env.logLevel = 'fatal';
    ort.env.wasm.numThreads = 1;
    ort.env.wasm.wasmBinary = wasm;
    const { externalData, freeDimensionOverrides } = run;
    const options = {
      executionProviders: ['wasm'],
      // As the file says it: fusions have computed something else.
      graphOptimizationLevel: 'basic',
      logSeverityLevel: 4,
      externalData,
      freeDimensionOverrides,
    };
    const session = await ort.InferenceSession.create(run.model, options);
    const feeds = {};
    for (const [name, { dtype, data, dims }] of Object.entries(run.feeds)) feeds[name] = new ort.Tensor(dtype, data, dims);
    const results = await session.run(feeds, [...new Set(run.parts.map(({ tensor }) => tensor))]);
    const dims = {};
    for (const [name, tensor] of Object.entries(results)) dims[name] = [...tensor.dims];
    const parts = run.parts.map(({ tensor, offset, size }) => {
      const { buffer, byteOffset, byteLength } = results[tensor].data;
      return new Uint8Array(buffer, byteOffset, byteLength).slice(offset, offset + size);
    });
    postMessage({ dims, parts });
  } catch (error) {
    postMessage({ failure: String(error && error.message || error) });
  }
};`;

/**
 * Runs a model once on the CPU, in a worker of its own with a copy of the runtime of its own, which both end with it: the page's thread, and
 * frames, do not notice.
 * @throws if no worker may be started here, it takes too long, or the model does not run.
 */
export function runInWorker({ script, wasm }: RuntimeSource, run: CpuRun, signal: AbortSignal): Promise<CpuOutputs> {
  const url = URL.createObjectURL(new Blob([SCRIPT], { type: 'text/javascript' }));
  return new Promise<CpuOutputs>((resolve, reject) => {
    const worker = new Worker(url);
    const end = (finish: () => void): void => {
      clearTimeout(timer);
      worker.terminate();
      finish();
    };
    const timer = setTimeout(
      () => end(() => reject(new Error(`it took more than ${LIMIT_MS / 1000} s there`))),
      LIMIT_MS,
    );
    signal.addEventListener('abort', () => end(() => reject(signal.reason as Error)), { once: true });
    worker.onerror = (event) => end(() => reject(new Error(event.message || 'this page lets no worker be started')));
    worker.onmessage = ({ data }: MessageEvent<CpuOutputs | { failure: string }>) =>
      end(() => ('failure' in data ? reject(new Error(data.failure)) : resolve(data)));
    worker.postMessage({ script, wasm, run });
  }).finally(() => URL.revokeObjectURL(url));
}
