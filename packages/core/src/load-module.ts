import { GaussianSplatError } from './errors.js';

/**
 * Code of our own that is fetched when it is first needed.
 *
 * @param what the code is for, as in "the code that reads PLY".
 * @param load imports it: a dynamic import that bundlers can see.
 * @throws GaussianSplatError `network/unreachable` that says which module could not be loaded.
 */
export async function loadModule<T>(what: string, load: () => Promise<T>): Promise<T> {
  try {
    return await load();
  } catch (cause) {
    throw new GaussianSplatError('network/unreachable', {
      where: what,
      expected: 'a module that can be loaded',
      // Browsers name its address here.
      found: cause instanceof Error ? `${cause.name}: ${cause.message}` : String(cause),
      remedy:
        'check the connection; serve the whole folder of the build, and allow its scripts in the Content-Security-Policy (script-src)',
      cause,
    });
  }
}
