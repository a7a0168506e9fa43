import type { ModelPlace, OpenedModel } from '@gaussian-splat/core';
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
