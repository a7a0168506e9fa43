/** The files of models: their headers, which a worker reads, and what lies beside them. */
import { GaussianSplatError } from '@gaussian-splat/core';
import type { ModelPlace, OpenedModel } from '@gaussian-splat/core/onnx';
import type { ModelSource } from '@gaussian-splat/generator';
import type { SceneLimits } from '../loading/protocol.js';
import type { SceneLoader } from '../loading/scene-loader.js';

/** Has headers of models read in a worker, within the limits of the page. */
export function readsHeaders(loader: SceneLoader, limits: SceneLimits | undefined): ModelSource['openHeader'] {
  return (place: ModelPlace, signal = new AbortController().signal) => {
    const request = { place, limits };
    const transfer = 'bytes' in place ? [place.bytes.buffer as ArrayBuffer] : undefined;
    return loader.ask<OpenedModel>({ type: 'model', request }, signal, ({ openModel }) => openModel(request, signal), {
      transfer,
    });
  };
}

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
