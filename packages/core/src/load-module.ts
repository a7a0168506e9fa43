import { GaussianSplatError } from './errors.js';

/**
 * Loads a module of this project on demand, and resolves to it.
 *
 * @param what Purpose of the code for error messages, as in "the code that reads PLY".
 * @param load Imports the module with a dynamic import that bundlers can see.
 * @throws GaussianSplatError `network/unreachable` with the module that could not be loaded.
 */
export async function loadModule<T>(what: string, load: () => Promise<T>): Promise<T> {
  try {
    return await load();
  } catch (cause) {
    throw new GaussianSplatError('network/unreachable', {
      where: what,
      expected: 'a module that can be loaded',
      // Messages of browsers contain the address of the module.
      found: cause instanceof Error ? `${cause.name}: ${cause.message}` : String(cause),
      remedy:
        'check the connection; serve the whole folder of the build, and allow its scripts in the Content-Security-Policy (script-src)',
      cause,
    });
  }
}
