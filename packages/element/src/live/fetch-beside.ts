import { GaussianSplatError } from '@gaussian-splat/core';

/**
 * Fetches what belongs to a model: a contract, a picture.
 * @param expected what the file ought to be, for people
 * @param remedy what to do without it
 * @throws GaussianSplatError `network/unreachable`, `network/status`; the reason of the signal.
 */
export async function fetchBeside(
  address: string,
  { credentials, signal }: { readonly credentials: RequestCredentials; readonly signal?: AbortSignal },
  expected: string,
  remedy: string,
): Promise<Response> {
  const url = new URL(address, document.baseURI).href;
  const where = url.slice(0, 200);
  const response = await fetch(url, { credentials, signal }).catch((cause: unknown) => {
    signal?.throwIfAborted();
    const found = (cause as Error).message;
    throw new GaussianSplatError('network/unreachable', { where, expected, found, remedy, cause });
  });
  if (response.ok) return response;
  throw new GaussianSplatError('network/status', { where, expected, found: `HTTP status ${response.status}`, remedy });
}
