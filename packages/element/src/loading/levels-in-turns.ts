/** Builds levels of detail in steps. The worker loads this module on demand. */
import { GaussianSplatError } from '@gaussian-splat/core';
import type { PackedGaussians } from '@gaussian-splat/renderer';
import { buildPackedLevels, type PackedLevels } from '@gaussian-splat/renderer/tools';

/**
 * Maximum duration of one step, ms. After it the worker handles other messages, such as concurrent loads and
 * cancellations.
 */
const TURN_MS = 30;

/**
 * Builds the levels of detail of a scene; undefined if the scene is too small for levels. Rejects with
 * GaussianSplatError `out-of-memory/allocation`, or with the signal's reason.
 */
export async function levelsInTurns(packed: PackedGaussians, signal: AbortSignal): Promise<PackedLevels | undefined> {
  try {
    return await build(packed, signal);
  } catch (error) {
    signal.throwIfAborted();
    throw outOfMemory(error);
  }
}

async function build(packed: PackedGaussians, signal: AbortSignal): Promise<PackedLevels | undefined> {
  const steps = buildPackedLevels(packed);
  for (let end = performance.now() + TURN_MS; ;) {
    const { done, value } = steps.next();
    if (done) return value;
    if (performance.now() < end) continue;
    await new Promise((resolve) => setTimeout(resolve));
    signal.throwIfAborted();
    end = performance.now() + TURN_MS;
  }
}

/**
 * Returns the error of a failed build. Lack of memory is the only possible cause, because the loaded scene is valid.
 */
function outOfMemory(cause: unknown): GaussianSplatError {
  return new GaussianSplatError('out-of-memory/allocation', {
    where: 'levels of detail',
    expected: 'enough memory to build them',
    found: cause instanceof Error ? cause.message : String(cause),
    remedy: 'use a smaller scene, or write it with gaussian-splat detail',
    cause,
  });
}
