import { GaussianSplatError } from '@gaussian-splat/core';
import { fetchBytes } from './fetch-bytes.js';
import { noteRuntimeBytes, WASM_BYTES, wasmBuild } from './runtime-progress.js';

// The type is `any` in pages without generators, which need neither onnxruntime-web nor its types.
// eslint-disable-next-line @typescript-eslint/ban-ts-comment
/** @ts-ignore */
// eslint-disable-next-line @typescript-eslint/consistent-type-imports
export type Ort = typeof import('onnxruntime-web/webgpu');

/** Time limit of one call of the runtime, milliseconds. */
let callLimit = 120_000;

/**
 * Sets the time limit of one call of the runtime, in milliseconds; default 120,000. A call that exceeds the limit is
 * abandoned together with its copy of the runtime, and the next call loads another copy. A model on the CPU blocks the
 * main thread and cannot be abandoned.
 */
export function setRunLimit(milliseconds: number): void {
  callLimit = milliseconds;
}

/** Pattern of WebAssembly error messages after which the memory of the module is invalid. */
const FATAL = /\bAborted\(|unreachable|out of bounds|table index/;

/** Whether an error leaves the memory of the WebAssembly module invalid. */
export const isFatal = (error: unknown): boolean =>
  error instanceof WebAssembly.RuntimeError || FATAL.test(String(error));

/**
 * Error of a call that never started, because an earlier call has broken this copy of the runtime. Another copy could
 * run it.
 */
export class RuntimeGone extends Error {}

/** Error of a call that has exceeded the time limit. */
class CallTimeout extends Error {}

export interface RuntimeSource {
  /** Absolute URL of the script. */
  readonly script: string;
  readonly wasm: ArrayBuffer;
}

/**
 * One loaded copy of ONNX Runtime. All calls go through one queue, because concurrent calls are not supported: two runs
 * never settle, and two creations block each other permanently.
 */
export class Runtime {
  readonly ort: Ort;
  /** Source files of the runtime, for another copy in a worker. */
  readonly source: RuntimeSource;
  #tail: Promise<unknown> = Promise.resolve();
  #breakage: unknown;

  constructor(ort: Ort, source: RuntimeSource) {
    this.ort = ort;
    this.source = source;
  }

  /** Whether this copy is unusable. {@link loadRuntime} then loads another. */
  get isBroken(): boolean {
    return this.#breakage !== undefined;
  }

  /** Whether this copy is unusable because a call has exceeded the time limit. */
  get hasTimedOut(): boolean {
    return this.#breakage instanceof CallTimeout;
  }

  /**
   * Runs a task after all earlier ones have ended or failed.
   * @throws RuntimeGone if an earlier task has broken this copy; errors of the task.
   */
  exclusive<T>(task: () => Promise<T>): Promise<T> {
    const result = this.#tail.then(() => this.#guard(task));
    this.#tail = result.catch(() => undefined);
    return result;
  }

  async #guard<T>(task: () => Promise<T>): Promise<T> {
    if (this.#breakage !== undefined) throw new RuntimeGone(String(this.#breakage));
    let timer: ReturnType<typeof setTimeout> | undefined;
    const limit = new Promise<never>((_, reject) => {
      const limit = callLimit;
      timer = setTimeout(() => reject((this.#breakage = new CallTimeout(`no result within ${limit} ms`))), limit);
    });
    try {
      return await Promise.race([task(), limit]);
    } catch (error) {
      if (isFatal(error)) this.#breakage = error;
      throw error;
    } finally {
      clearTimeout(timer);
    }
  }
}

let location: string | undefined;
let loading: Promise<Runtime> | undefined;
let copies = 0;

/**
 * Sets the folder of the files {@link RUNTIME_FILES} of onnxruntime-web 1.30.0. Default: the folder `onnxruntime/` next
 * to this module, as in the CDN build.
 * @param folder Absolute URL, or a URL relative to the page.
 */
export function setRuntimeLocation(folder: string | URL): void {
  const url = new URL(folder, globalThis.location?.href);
  if (!url.pathname.endsWith('/')) url.pathname += '/';
  if (url.href !== location) loading = undefined;
  location = url.href;
}

/** Whether the runtime has been requested. */
export const isRuntimeRequested = (): boolean => loading !== undefined;

/**
 * Returns the page's copy of ONNX Runtime, which the first call fetches: the build with JSPI if the browser supports
 * it, else the larger one. Both have kernels for WebGPU and for the CPU.
 * @throws GaussianSplatError `network/*` if a file is unavailable; another call fetches it again.
 */
export async function loadRuntime(): Promise<Runtime> {
  const current = (loading ??= load());
  try {
    const runtime = await current;
    if (!runtime.isBroken) return runtime;
  } catch (error) {
    if (loading === current) loading = undefined;
    throw error;
  }
  if (loading === current) loading = load();
  return loading;
}

async function load(): Promise<Runtime> {
  const folder = location ?? folderBeside(import.meta.url);
  const build = wasmBuild();
  const script = `${folder}ort.${build === 'jspi' ? 'jspi' : 'webgpu'}.bundle.min.mjs`;
  const [ort, wasmBinary] = await Promise.all([importScript(script), fetchWasm(folder, build)]).catch(
    (error: unknown) => {
      noteRuntimeBytes(undefined);
      throw error;
    },
  );
  noteRuntimeBytes(null);
  // Log messages are redundant, because the errors contain them.
  ort.env.logLevel = 'fatal';
  ort.env.wasm.numThreads = 1;
  ort.env.wasm.wasmBinary = wasmBinary.buffer;
  return new Runtime(ort, { script: new URL(script, globalThis.location?.href).href, wasm: wasmBinary.buffer });
}

/**
 * Returns the URL of the folder `onnxruntime/` next to a module. Does not use `new URL(…, import.meta.url)`, which
 * bundlers treat as a file to copy.
 * @throws GaussianSplatError `network/unreachable` if the URL of the module is unusable: bundlers remove it, or leave
 * that of a file on the build machine.
 */
export function folderBeside(module: string | undefined): string {
  const isHidden = !module || (module.startsWith('file:') && globalThis.location?.protocol.startsWith('http'));
  if (!isHidden) return module.replace(/[^/]*$/, 'onnxruntime/');
  throw new GaussianSplatError('network/unreachable', {
    where: 'onnxruntime/',
    expected: 'the folder of the files of onnxruntime-web 1.30.0',
    found: 'no address of this code, which a bundler has rewritten',
    remedy: REMEDY.replace('there', 'on your server').replace('; or name', ', and name'),
  });
}

/** Files of the folder `dist` of onnxruntime-web that pages with a generator fetch, two for each of its builds. */
export const RUNTIME_FILES = [
  'ort.jspi.bundle.min.mjs',
  'ort.webgpu.bundle.min.mjs',
  'ort-wasm-simd-threaded.jspi.wasm',
  'ort-wasm-simd-threaded.asyncify.wasm',
] as const;

const REMEDY =
  `put these files of node_modules/onnxruntime-web/dist there (npm install onnxruntime-web@1.30.0): ${RUNTIME_FILES.join(', ')}; ` +
  'or name their folder with GaussianSplatElement.runtimeLocation (without the element: setRuntimeLocation)';

/** Time limit for loading a script, milliseconds, because its progress is not observable. */
const SCRIPT_LIMIT_MS = 120_000;

/**
 * Imports a copy of the script. Each copy needs its own URL, because a module is evaluated once per URL.
 * @throws GaussianSplatError `network/unreachable`
 */
async function importScript(script: string): Promise<Ort> {
  const address = copies++ === 0 ? script : `${script}?copy=${copies}`;
  let timer: ReturnType<typeof setTimeout> | undefined;
  const silence = new Promise<never>((_, reject) => {
    timer = setTimeout(() => reject(new Error(`no result within ${SCRIPT_LIMIT_MS / 1000} s`)), SCRIPT_LIMIT_MS);
  });
  try {
    return (await Promise.race([import(/* @vite-ignore */ /* webpackIgnore: true */ address), silence])) as Ort;
  } catch (cause) {
    throw new GaussianSplatError('network/unreachable', {
      where: script.slice(0, 200),
      expected: 'the script of onnxruntime-web 1.30.0',
      // Every copy has the same message, so that it is reported only once.
      found: ((cause as Error)?.message ?? 'nothing').replace(address, script),
      remedy: REMEDY,
      cause,
    });
  } finally {
    clearTimeout(timer);
  }
}

/**
 * Fetches the WebAssembly module of a build. The runtime does not fetch it itself, because a copy that fails to fetch
 * it never works again.
 * @throws GaussianSplatError `network/*`
 */
async function fetchWasm(folder: string, build: keyof typeof WASM_BYTES): Promise<Uint8Array<ArrayBuffer>> {
  const expected = WASM_BYTES[build];
  const url = `${folder}ort-wasm-simd-threaded.${build}.wasm`;
  const bytes = await fetchBytes(url, {
    expected,
    onProgress: (loaded, total = expected) => noteRuntimeBytes([loaded, total]),
    mayBeMissing: true,
  });
  if (bytes?.[0] === 0 && bytes[1] === 0x61 && bytes[2] === 0x73 && bytes[3] === 0x6d) return bytes;
  throw new GaussianSplatError('network/status', {
    where: url.slice(0, 200),
    expected: 'the WebAssembly file of onnxruntime-web 1.30.0',
    found: bytes ? 'something else, perhaps a web page' : 'no such file',
    remedy: REMEDY,
  });
}
