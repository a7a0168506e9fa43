import type { Ort, RuntimeSource } from '../runtime/load-runtime.js';

/** Run of an ONNX model that a worker executes on the CPU: the model, its inputs, and the requested outputs. */
export interface CpuRun {
  readonly model: Uint8Array;
  readonly externalData: readonly { readonly path: string; readonly data: Uint8Array }[];
  readonly freeDimensionOverrides: Readonly<Record<string, number>> | undefined;
  readonly feeds: Readonly<
    Record<string, { readonly dtype: string; readonly dims: readonly number[]; readonly data: ArrayBufferView }>
  >;
  /** Requested ranges of outputs, in bytes. */
  readonly parts: readonly { readonly tensor: string; readonly offset: number; readonly size: number }[];
}

export interface CpuOutputs {
  readonly dims: Readonly<Record<string, readonly number[]>>;
  /** Bytes of the requested ranges, in the order of the request. */
  readonly parts: readonly Uint8Array[];
}

/** Time limit of a run including the start of the runtime, milliseconds. */
const LIMIT_MS = 60_000;

/** Message to a worker of {@link StartWorker}. */
export interface CpuCheckMessage {
  readonly type: 'run-on-cpu';
  readonly script: string;
  readonly wasm: ArrayBuffer;
  readonly run: CpuRun;
}

type Answer = { readonly type: 'ran-on-cpu'; readonly outputs?: CpuOutputs; readonly failure?: string };

/**
 * Starts a worker that calls {@link handleCpuRun} for messages of type `run-on-cpu`. Needed for pages whose
 * Content-Security-Policy has no `blob:` in `worker-src`, or whose Trusted Types require named policies for script
 * addresses.
 */
export type StartWorker = () => Worker;

/**
 * Executes a model in the worker, and posts its output. The function uses only its arguments, because its source text
 * is the script of the default worker.
 */
export async function handleCpuRun({ script, wasm, run }: CpuCheckMessage): Promise<void> {
  const post = postMessage as (answer: Answer, transfer?: Transferable[]) => void;
  try {
    const ort = (await import(/* @vite-ignore */ /* webpackIgnore: true */ script)) as Ort;
    ort.env.logLevel = 'fatal';
    ort.env.wasm.numThreads = 1;
    ort.env.wasm.wasmBinary = wasm;
    const { externalData, freeDimensionOverrides } = run;
    const session = await ort.InferenceSession.create(run.model, {
      executionProviders: ['wasm'],
      // The optimization level excludes fusions, because some of them compute wrong results.
      graphOptimizationLevel: 'basic',
      logSeverityLevel: 4,
      externalData,
      freeDimensionOverrides,
    });
    const feeds: Record<string, InstanceType<Ort['Tensor']>> = {};
    for (const [name, { dtype, data, dims }] of Object.entries(run.feeds))
      feeds[name] = new ort.Tensor(dtype as 'float32', data as Float32Array, dims);
    const results = await session.run(feeds, [...new Set(run.parts.map(({ tensor }) => tensor))]);
    const dims: Record<string, readonly number[]> = {};
    for (const [name, tensor] of Object.entries(results)) dims[name] = [...tensor.dims];
    const parts = run.parts.map(({ tensor, offset, size }) => {
      const { buffer, byteOffset, byteLength } = results[tensor].data as Float32Array;
      return new Uint8Array(buffer, byteOffset, byteLength).slice(offset, offset + size);
    });
    post({ type: 'ran-on-cpu', outputs: { dims, parts } });
  } catch (error) {
    post({ type: 'ran-on-cpu', failure: error instanceof Error ? error.message : String(error) });
  }
}

/** Starts the default worker: of the same origin, without support by bundlers. */
function startOwnWorker(): Worker {
  const text = `onmessage = ({ data }) => (${String(handleCpuRun)})(data);`;
  const url = URL.createObjectURL(new Blob([text], { type: 'text/javascript' }));
  try {
    return new Worker(url);
  } finally {
    // The browser has requested the script by then.
    setTimeout(() => URL.revokeObjectURL(url), 10_000);
  }
}

/**
 * Runs a model once on the CPU, in a worker with its own copy of the runtime that ends after the run. The main thread
 * is not blocked.
 * @throws Error if workers are not allowed, the time limit is exceeded, or the model fails; the signal's reason
 */
export function runInWorker(
  { script, wasm }: RuntimeSource,
  run: CpuRun,
  signal: AbortSignal,
  startWorker: StartWorker = startOwnWorker,
): Promise<CpuOutputs> {
  return new Promise<CpuOutputs>((resolve, reject) => {
    const worker = startWorker();
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
    worker.addEventListener('error', (event) => {
      // The rejection reports the error. Without this call, the page would report an uncaught error, too.
      event.preventDefault();
      end(() => reject(new Error(event.message || 'this page lets no worker be started')));
    });
    worker.addEventListener('message', ({ data }: MessageEvent<Answer | { readonly type: 'ready' }>) => {
      if (data.type !== 'ran-on-cpu') return;
      const { outputs, failure } = data;
      end(() => (outputs ? resolve(outputs) : reject(new Error(failure))));
    });
    const message: CpuCheckMessage = { type: 'run-on-cpu', script, wasm, run };
    worker.postMessage(message);
  });
}
