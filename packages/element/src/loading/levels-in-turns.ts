/** Loaded by the worker on demand. */
import { GaussianSplatError } from '@gaussian-splat/core';
import type { PackedGaussians } from '@gaussian-splat/renderer';
import { buildPackedLevels, type PackedLevels } from '@gaussian-splat/renderer/tools';

/** Milliseconds after which it yields to other messages: of concurrent loads, and cancellations. */
const TURN_MS = 30;

/**
 * Builds the levels of detail of a scene; rejects with GaussianSplatError `out-of-memory/allocation`, or the signal's
 * reason.
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

/** Only memory can be insufficient for levels of a loaded scene. */
function outOfMemory(cause: unknown): GaussianSplatError {
  return new GaussianSplatError('out-of-memory/allocation', {
    where: 'levels of detail',
    expected: 'memory enough to build them',
    found: cause instanceof Error ? cause.message : String(cause),
    remedy: 'use a smaller scene, or write it with gaussian-splat detail',
    cause,
  });
}
