import { GaussianSplatError, loadModule } from '@gaussian-splat/core';
import type { LoadBudget } from '../budget.js';
import { damaged } from '../faults.js';

/** Options of the function that creates a library compiled by Emscripten. */
interface EmscriptenHooks {
  instantiateWasm(imports: WebAssembly.Imports, onInstance: (instance: WebAssembly.Instance) => void): object;
}

/** Module of a decoder. `wasm` is its deflated WebAssembly in base64; empty if a bundle does not contain it. */
export interface DecoderScript<T> {
  readonly create: (hooks: EmscriptenHooks) => Promise<T>;
  readonly wasm: string;
}

const PAGE_BYTES = 65_536;

/**
 * A decoder in WebAssembly, which is loaded at its first use. The growth of its memory is charged to the budget of the
 * load.
 */
export class WasmDecoder<T> {
  readonly #name: string;
  readonly #load: () => Promise<DecoderScript<T>>;
  readonly #budget: LoadBudget;
  #starting: Promise<{ readonly library: T }> | undefined;
  /** Error of the budget when memory grew. Emscripten catches it and throws another error. */
  #refused: unknown;

  /**
   * @param name Name of the format in error messages.
   * @param load Imports the module of the decoder.
   */
  constructor(name: string, budget: LoadBudget, load: () => Promise<DecoderScript<T>>) {
    this.#name = name;
    this.#load = load;
    this.#budget = budget;
  }

  /**
   * Calls a function with the library, and returns its result.
   * @param where Part of the file in error messages.
   * @param decode Function that uses the library; it must not be asynchronous.
   * @throws GaussianSplatError `decode/corrupt` for other errors of the callback; `decode/unsupported` without
   *   WebAssembly; `out-of-memory/budget`; `network/unreachable` if the decoder cannot be loaded.
   */
  async run<R>(where: string, decode: (library: T) => R): Promise<R> {
    this.#starting ??= this.#start(where);
    const { library } = await this.#starting;
    try {
      return decode(library);
    } catch (error) {
      if (this.#refused !== undefined) throw this.#refused;
      if (error instanceof GaussianSplatError) throw error;
      throw damaged(where, `data of ${this.#name}`, String((error as Error).message ?? error), 'decode/corrupt', error);
    }
  }

  async #start(where: string): Promise<{ readonly library: T }> {
    const { create, wasm } = await loadModule(`the decoder of ${this.#name}`, async () => {
      const script = await this.#load();
      if (script.wasm === '') throw new Error('a script of one file, which has no decoders');
      return script;
    });
    const code = await WebAssembly.compile(await inflated(wasm)).catch((cause: unknown) => {
      throw forbidden(this.#name, where, cause);
    });
    return new Promise((resolve, reject) => {
      const instantiate = async (imports: WebAssembly.Imports): Promise<WebAssembly.Instance> => {
        const instance = await WebAssembly.instantiate(code, imports);
        this.#charge(instance, where);
        return instance;
      };
      create({
        instantiateWasm: (imports, onInstance) => {
          instantiate(imports).then(onInstance).catch(reject);
          return {};
        },
        // The library is wrapped in an object, because a promise cannot resolve to an object with a method `then`.
      }).then((library) => resolve({ library }), reject);
    });
  }

  /** Charges the memory of an instance, at once and whenever it grows. */
  #charge({ exports }: WebAssembly.Instance, where: string): void {
    const memory = Object.values(exports).find((value) => value instanceof WebAssembly.Memory)!;
    this.#budget.take(memory.buffer.byteLength, where);
    const grow = memory.grow.bind(memory);
    memory.grow = (pages) => {
      try {
        this.#budget.take(pages * PAGE_BYTES, where);
      } catch (error) {
        this.#refused = error;
        throw error;
      }
      return grow(pages);
    };
  }
}

async function inflated(base64: string): Promise<ArrayBuffer> {
  const bytes = Uint8Array.from(atob(base64), (character) => character.charCodeAt(0));
  const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream('deflate-raw'));
  return new Response(stream).arrayBuffer();
}

const forbidden = (name: string, where: string, cause: unknown): GaussianSplatError =>
  new GaussianSplatError('decode/unsupported', {
    where,
    expected: `permission to run WebAssembly, which decodes ${name}`,
    found: (cause as Error).message,
    remedy: `allow 'wasm-unsafe-eval' in script-src of the page's Content-Security-Policy, or write the file without ${name}`,
    cause,
  });
