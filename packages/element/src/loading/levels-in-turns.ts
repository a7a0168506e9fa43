/** Loaded by the worker when first asked for. */
import { buildPackedLevels, type PackedGaussians, type PackedLevels } from '@gaussian-splat/renderer';

/** Milliseconds after which others have their turn: scenes that are loaded meanwhile, and whoever calls it off. */
const TURN_MS = 30;

/** Builds the levels of detail of a scene; rejects with the signal's reason. */
export async function levelsInTurns(packed: PackedGaussians, signal: AbortSignal): Promise<PackedLevels | undefined> {
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
