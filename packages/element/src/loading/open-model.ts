/** Loaded by the worker for the first generator, because headers of models are untrusted, too. */
import { GaussianSplatError } from '@gaussian-splat/core';
import { openHeader, type OnnxHeader, type OpenedModel } from '@gaussian-splat/core/onnx';
import { fileLimits, fileName, limitsFrom, named } from './load-scene.js';
import type { ModelRequest } from './protocol.js';

/**
 * Maximum number of nodes, tensors and values of a graph, because the main thread processes each of them. Real ones
 * have thousands.
 */
const MAX_PARTS = 200_000;

/**
 * Reads the header of a model. Throws GaussianSplatError (`network/*`, `decode/*`, `out-of-memory/*`), or the signal's
 * reason once that is aborted.
 */
export async function openModel({ place, limits }: ModelRequest, signal: AbortSignal): Promise<OpenedModel> {
  const name = 'url' in place ? fileName(place.url) : place.name;
  const { maxBytes = Infinity, maxSeconds = Infinity } = fileLimits(limitsFrom({ limits })());
  const limit = maxSeconds < 2e6 ? AbortSignal.timeout(1000 * Math.max(0, maxSeconds)) : undefined;
  try {
    const model = await openHeader(place, limit ? AbortSignal.any([signal, limit]) : signal);
    const beside = model.header.externalFiles.reduce((sum, { byteLength }) => sum + byteLength, 0);
    if (model.size + beside > maxBytes) throw tooMuch(name, `at most ${maxBytes} bytes`, `${model.size + beside}`);
    const parts = partsOf(model.header);
    if (parts > MAX_PARTS) throw tooMuch(name, `at most ${MAX_PARTS} nodes and tensors`, String(parts));
    return model;
  } catch (error) {
    signal.throwIfAborted();
    if (limit?.aborted) throw tooMuch(name, `at most ${maxSeconds} s`, 'more');
    throw named(error, name);
  }
}

const partsOf = ({ nodes, stored, values, metadata, inputs, outputs, externalFiles }: OnnxHeader): number =>
  nodes.length + stored.size + values.size + metadata.size + inputs.length + outputs.length + externalFiles.length;

const tooMuch = (where: string, expected: string, found: string): GaussianSplatError =>
  new GaussianSplatError('out-of-memory/budget', {
    ...{ where, expected, found },
    remedy: 'use a smaller model, or allow for more',
  });
