import { GaussianSplatError } from './errors.js';

/**
 * Loads a module of this project on demand.
 *
 * @param what Purpose of the code, as in "the code that reads PLY".
 * @param load Imports it: a dynamic import that bundlers can see.
 * @throws GaussianSplatError `network/unreachable` that names the module that could not be loaded.
 */
export async function loadModule<T>(what: string, load: () => Promise<T>): Promise<T> {
  try {
    return await load();
  } catch (cause) {
    throw new GaussianSplatError('network/unreachable', {
      where: what,
      expected: 'a module that can be loaded',
      // Browsers include the address of the module here.
      found: cause instanceof Error ? `${cause.name}: ${cause.message}` : String(cause),
      remedy:
        'check the connection; serve the whole folder of the build, and allow its scripts in the Content-Security-Policy (script-src)',
      cause,
    });
  }
}
