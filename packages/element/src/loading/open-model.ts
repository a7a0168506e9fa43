/**
 * Reads the headers of ONNX models in the worker, because they are untrusted, too. The worker loads this module for the
 * first generator.
 */
import { GaussianSplatError } from '@gaussian-splat/core';
import { openHeader, type ModelPlace, type OnnxHeader, type OpenedModel } from '@gaussian-splat/core/onnx';
import { fileLimits, fileName, limitsFrom, named } from './load-scene.js';
import type { SceneLimits } from './protocol.js';

/** A model whose header is to be read. */
export interface ModelRequest {
  readonly place: ModelPlace;
  readonly limits?: SceneLimits | undefined;
}

/**
 * Maximum number of nodes, tensors, values, metadata entries and files of a model, because the main thread processes
 * each of them. Real models have thousands.
 */
const MAX_PARTS = 200_000;
/** Maximum number of names of inputs, outputs and attributes of all nodes, for the same reason. */
const MAX_NAMES = 5 * MAX_PARTS;

/**
 * Reads the header of a model. Throws GaussianSplatError (`network/*`, `decode/*`, `out-of-memory/*`), or the signal's
 * reason if that is aborted.
 */
export async function openModel({ place, limits }: ModelRequest, signal: AbortSignal): Promise<OpenedModel> {
  const name = 'url' in place ? fileName(place.url) : place.name;
  const { maxBytes = Infinity, maxSeconds = Infinity } = fileLimits(limitsFrom({ limits })());
  const limit = maxSeconds < 2e6 ? AbortSignal.timeout(1000 * Math.max(0, maxSeconds)) : undefined;
  try {
    const model = await openHeader({ ...place, maxBytes }, limit ? AbortSignal.any([signal, limit]) : signal);
    const beside = model.header.externalFiles.reduce((sum, { byteLength }) => sum + byteLength, 0);
    if (model.size + beside > maxBytes) throw tooMuch(name, `at most ${maxBytes} bytes`, `${model.size + beside}`);
    const parts = partsOf(model.header);
    if (parts > MAX_PARTS) throw tooMuch(name, `at most ${MAX_PARTS} nodes and tensors`, String(parts));
    const names = namesOf(model.header);
    if (names > MAX_NAMES) throw tooMuch(name, `at most ${MAX_NAMES} names in nodes`, String(names));
    return model;
  } catch (error) {
    signal.throwIfAborted();
    if (limit?.aborted) throw tooMuch(name, `at most ${maxSeconds} s`, 'more');
    throw named(error, name);
  }
}

const partsOf = ({ nodes, stored, values, metadata, inputs, outputs, externalFiles }: OnnxHeader): number =>
  nodes.length + stored.size + values.size + metadata.size + inputs.length + outputs.length + externalFiles.length;

const namesOf = ({ nodes }: OnnxHeader): number =>
  nodes.reduce(
    (sum, { inputs, outputs, numbers = {}, lists = {} }) =>
      sum + inputs.length + outputs.length + Object.keys(numbers).length + Object.keys(lists).length,
    0,
  );

const tooMuch = (where: string, expected: string, found: string): GaussianSplatError =>
  new GaussianSplatError('out-of-memory/budget', {
    ...{ where, expected, found },
    remedy: 'use a smaller model, or raise the limit',
  });
