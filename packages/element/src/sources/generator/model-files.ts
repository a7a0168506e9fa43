/** Reads the headers of models, in a worker, and fetches the files beside them. */
import { GaussianSplatError } from '@gaussian-splat/core';
import { bytesOf, fetchPatiently } from '@gaussian-splat/core/fetch';
import type { ModelPlace } from '@gaussian-splat/core/onnx';
import type { ModelSource } from '@gaussian-splat/generator';
import type { SceneLimits } from '../../loading/protocol.js';
import type { SceneLoader } from '../../loading/scene-loader.js';

/** Returns a function that reads the header of a model in a worker, within the limits of the page. */
export function readsHeaders(loader: SceneLoader, limits: SceneLimits | undefined): ModelSource['openHeader'] {
  return (place: ModelPlace, signal = new AbortController().signal) => {
    const transfer = 'bytes' in place ? [place.bytes.buffer as ArrayBuffer] : undefined;
    return loader.ask('model', { place, limits }, signal, { transfer });
  };
}

/**
 * Fetches a file of a model: a contract or an image.
 * @param address URL, absolute or relative to the document.
 * @param maxBytes Maximum size of the file.
 * @param expected Description of the expected file, for the message of an error.
 * @param remedy Suggested correction, for the message of an error.
 * @throws GaussianSplatError `network/*`, or the reason of the signal.
 */
export async function fetchBeside(
  address: string,
  { credentials, signal }: { readonly credentials: RequestCredentials; readonly signal?: AbortSignal },
  maxBytes: number,
  expected: string,
  remedy: string,
): Promise<Uint8Array<ArrayBuffer>> {
  const url = new URL(address, document.baseURI).href;
  const where = url.slice(0, 200);
  const fail = (code: 'unreachable' | 'status' | 'interrupted', found: string, cause?: unknown): never => {
    signal?.throwIfAborted();
    throw new GaussianSplatError(`network/${code}`, { where, expected, found, remedy, cause });
  };
  const response = await fetchPatiently(url, { credentials, signal }).catch((cause: Error) =>
    fail('unreachable', cause.message, cause),
  );
  if (!response.ok) return fail('status', `HTTP status ${response.status}`);
  return bytesOf(response, undefined, maxBytes).catch((cause: Error) => fail('interrupted', cause.message, cause));
}
