import { GaussianSplatError } from '@gaussian-splat/core';
import { fetchBytes } from './fetch-bytes.js';
import { noteRuntimeBytes, WASM_BYTES, wasmBuild } from './runtime-progress.js';

// Who shows no generator need not have onnxruntime-web, nor its types: then this is any.
// eslint-disable-next-line @typescript-eslint/ban-ts-comment
/** @ts-ignore */
// eslint-disable-next-line @typescript-eslint/consistent-type-imports
export type Ort = typeof import('onnxruntime-web/webgpu');

/** Longest that one call of the runtime may take, ms. */
let callLimit = 120_000;

/**
 * How long one call of the runtime may take, milliseconds; default 120,000. What has not ended by then is given up, and with it that copy of the
 * runtime: the next call loads another. A model on the CPU holds the page's thread and cannot be given up.
 */
export function setRunLimit(milliseconds: number): void {
  callLimit = milliseconds;
}

/** What WebAssembly says when the module's memory can no longer be trusted. */
const FATAL = /\bAborted\(|unreachable|out of bounds|table index/;

/** A call that never began, since an earlier one has broken this copy of the runtime: another copy would do it. */
export class RuntimeGone extends Error {}

export interface RuntimeSource {
  /** Absolute address of the script. */
  readonly script: string;
  readonly wasm: ArrayBuffer;
}

/**
 * One loaded copy of ONNX Runtime. Its calls must never overlap: two runs at a time never settle, two creations refuse each other
 * for good. So there is one queue for everything.
 */
export class Runtime {
  readonly ort: Ort;
  /** Where it came from, for another copy in a worker. */
  readonly source: RuntimeSource;
  #tail: Promise<unknown> = Promise.resolve();
  #breakage: unknown;

  constructor(ort: Ort, source: RuntimeSource) {
    this.ort = ort;
    this.source = source;
  }

  /** True once this copy cannot be used any more; {@link loadRuntime} then loads another. */
  get isBroken(): boolean {
    return this.#breakage !== undefined;
  }

  /**
   * Runs a task when all earlier ones have ended, however they ended.
   * @throws RuntimeGone if one of them has broken this copy; what the task throws.
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
      timer = setTimeout(() => reject((this.#breakage = new Error(`no end within ${limit} ms`))), limit);
    });
    try {
      return await Promise.race([task(), limit]);
    } catch (error) {
      if (error instanceof WebAssembly.RuntimeError || FATAL.test(String(error))) this.#breakage = error;
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
 * Where four files of onnxruntime-web 1.30.0 are: `ort.jspi.bundle.min.mjs`, `ort.webgpu.bundle.min.mjs`, `ort-wasm-simd-threaded.jspi.wasm` and
 * `ort-wasm-simd-threaded.asyncify.wasm`. Default: the folder `onnxruntime/` beside this module, where the CDN build has them.
 * @param folder absolute, or relative to the page.
 */
export function setRuntimeLocation(folder: string | URL): void {
  const url = new URL(folder, globalThis.location?.href);
  if (!url.pathname.endsWith('/')) url.pathname += '/';
  if (url.href !== location) loading = undefined;
  location = url.href;
}

/** True once a byte of the runtime has been asked for. */
export const isRuntimeRequested = (): boolean => loading !== undefined;

/**
 * The page's copy of ONNX Runtime: fetched when first asked for; the build for browsers that can suspend WebAssembly where they can
 * (JSPI), else the larger one for all others. Both hold kernels for WebGPU and for the CPU.
 * @throws GaussianSplatError `network/*` if a file of it cannot be had; asked again, it is fetched again.
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
  // What it has to say comes with its errors, which are passed on.
  ort.env.logLevel = 'fatal';
  ort.env.wasm.numThreads = 1;
  ort.env.wasm.wasmBinary = wasmBinary.buffer;
  return new Runtime(ort, { script: new URL(script, globalThis.location?.href).href, wasm: wasmBinary.buffer });
}

/**
 * The folder `onnxruntime/` beside a module. Not by `new URL(…, import.meta.url)`, which bundlers take for a file that they are to copy.
 * @throws GaussianSplatError `network/unreachable` where the address says nothing: bundlers leave none, or that of a file on the disk they ran on.
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

const FILES =
  'ort.jspi.bundle.min.mjs, ort.webgpu.bundle.min.mjs, ort-wasm-simd-threaded.jspi.wasm, ort-wasm-simd-threaded.asyncify.wasm';

const REMEDY =
  `put these files of node_modules/onnxruntime-web/dist there (npm install onnxruntime-web@1.30.0): ${FILES}; ` +
  'or name their folder with GaussianSplatElement.runtimeLocation (without the element: setRuntimeLocation)';

/** How long a script may take, ms: nobody sees how much of a module has arrived. */
const SCRIPT_LIMIT_MS = 120_000;

/** A module is evaluated once for each address: another copy needs another address. */
async function importScript(script: string): Promise<Ort> {
  const address = copies++ === 0 ? script : `${script}?copy=${copies}`;
  let timer: ReturnType<typeof setTimeout> | undefined;
  const silence = new Promise<never>((_, reject) => {
    timer = setTimeout(() => reject(new Error(`no end within ${SCRIPT_LIMIT_MS / 1000} s`)), SCRIPT_LIMIT_MS);
  });
  try {
    return (await Promise.race([import(/* @vite-ignore */ /* webpackIgnore: true */ address), silence])) as Ort;
  } catch (cause) {
    throw new GaussianSplatError('network/unreachable', {
      where: script.slice(0, 200),
      expected: 'the script of onnxruntime-web 1.30.0',
      // The same whichever copy it was: what is told twice is told once.
      found: ((cause as Error)?.message ?? 'nothing').replace(address, script),
      remedy: REMEDY,
      cause,
    });
  } finally {
    clearTimeout(timer);
  }
}

/** Fetched by us: a copy of the runtime that did not find its WebAssembly never works again. */
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
