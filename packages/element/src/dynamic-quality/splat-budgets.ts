/** Splat budgets of streamed scenes, which follow the headroom of frames. */
import type { MemoryLedger, StreamProgress } from '@gaussian-splat/renderer';
import { budgetBytes, hasMemory, type Reservation } from '@gaussian-splat/renderer/tools';
import type { LodSettings } from '../gpu/backend.js';
import { AIM, LONGER, LONGEST_HOLD_MS } from './next-quality.js';
import { HOLD_MS } from './start.js';

/** Maximum and minimum factor of one step upward. Each enlarges the buffers of frames, which are allocated again. */
const [MAX_STEP, MIN_STEP] = [1.5, 1.05];
/** Fraction of the rest of the memory budget that the buffers for larger budgets may take, because scenes may follow. */
const SHARE_OF_REST = 0.5;

/** The streamed scene whose budget changes. */
export interface BudgetedScene {
  readonly place: { readonly memory: MemoryLedger; readonly context?: GPUDevice | WebGL2RenderingContext };
  readonly gaussians: { readonly progress?: Pick<StreamProgress, 'error' | 'budgetError'> };
  readonly detail: LodSettings;
  setDetail(detail: LodSettings): void;
}

/** Typical time of a frame at full quality, and the target, ms; and the time of the measurement, ms. */
export interface FrameTime {
  readonly now: number;
  readonly milliseconds: number;
  readonly targetMs: number;
}

/**
 * Changes the splat budgets of scenes with a `splatRange`: upward while a budget limits the view more than missing pages
 * do and the larger one is predicted to be fast enough, downward before frames lose quality. The time of a frame is
 * assumed to be proportional to its splats, at most.
 */
export class SplatBudgets {
  readonly #scenes: () => readonly BudgetedScene[];
  /** Scenes with a changed budget. */
  readonly #changed = new Set<BudgetedScene>();
  #reservation: Reservation | undefined;
  /** Largest budget for which the device has memory, and the smallest one that it refuses, as far as they are known. */
  #confirmed = 0;
  #refused = Infinity;
  #isAsking = false;
  #heldUntil = -Infinity;
  #grewAt = -Infinity;
  #hold = HOLD_MS;

  constructor(scenes: () => readonly BudgetedScene[]) {
    this.#scenes = scenes;
  }

  /** Enlarges the budgets if the time allows it. @returns Whether a budget has changed. */
  grow({ now, milliseconds, targetMs }: FrameTime): boolean {
    const factor = Math.min(MAX_STEP, (AIM * targetMs) / milliseconds);
    if (now < this.#heldUntil || factor < MIN_STEP) return false;
    // While missing pages have the larger error, more splats would be more pages.
    const isLimited = ({ gaussians: { progress }, detail: { detail = 0 } }: BudgetedScene): boolean =>
      (progress?.budgetError ?? 0) > Math.max(detail, progress?.error ?? 0);
    const limited = this.#scenes().filter(isLimited);
    if (limited.length === 0 || !this.#isConfirmed(limited, factor) || !this.#reserve(limited, factor)) return false;
    this.#grewAt = now;
    return this.#scale(limited, factor);
  }

  /** Reduces enlarged budgets to what the time allows. @returns Whether a budget has changed. */
  shrink({ now, milliseconds, targetMs }: FrameTime): boolean {
    if (!this.#scale([...this.#changed], Math.min(1, (AIM * targetMs) / milliseconds))) return false;
    // A step that must be undone at once, more than once, is not repeated soon. Arriving pages may slow single frames.
    if (now - this.#grewAt >= HOLD_MS) this.#hold = HOLD_MS;
    this.#heldUntil = now + this.#hold;
    this.#hold = Math.min(LONGEST_HOLD_MS, LONGER * this.#hold);
    return true;
  }

  /** Sets all budgets to those that the scenes were loaded with, and releases the reserved memory. */
  reset(): void {
    for (const scene of this.#changed) setBudget(scene, scene.detail.splatRange![0]);
    this.#changed.clear();
    this.#reservation?.release();
    this.#reservation = undefined;
    this.#confirmed = 0;
    this.#refused = Infinity;
    this.#heldUntil = this.#grewAt = -Infinity;
    this.#hold = HOLD_MS;
  }

  #scale(scenes: readonly BudgetedScene[], factor: number): boolean {
    const isChanged = scenes.map((scene) => {
      this.#changed.add(scene);
      return setBudget(scene, scaled(scene, factor));
    });
    return isChanged.includes(true);
  }

  /**
   * Returns whether the device has confirmed memory for the larger budgets, beside the present buffers, and asks it
   * otherwise. After a refusal the budgets stay as they are.
   */
  #isConfirmed(scenes: readonly BudgetedScene[], factor: number): boolean {
    const max = (step: number): number => Math.max(...scenes.map((scene) => scaled(scene, step)));
    const { context } = scenes[0].place;
    if (context === undefined || max(factor) <= this.#confirmed) return true;
    const wanted = max(MAX_STEP);
    if (!this.#isAsking && wanted < this.#refused) void this.#ask(context as GPUDevice, wanted);
    return false;
  }

  async #ask(device: GPUDevice, splatBudget: number): Promise<void> {
    this.#isAsking = true;
    const hasRoom = await hasMemory(device, budgetBytes(splatBudget)).catch(() => false);
    this.#isAsking = false;
    if (hasRoom) this.#confirmed = splatBudget;
    else this.#refused = splatBudget;
  }

  /** Reserves the memory of the larger budgets. @returns False if the memory budget of the page leaves too little. */
  #reserve(scenes: readonly BudgetedScene[], factor: number): boolean {
    // The scenes of a page share the buffers of a frame, which have room for the largest budget.
    const max = (of: (scene: BudgetedScene) => number): number => Math.max(...scenes.map(of));
    const bytes =
      budgetBytes(max((scene) => scaled(scene, factor))) - budgetBytes(max(({ detail }) => detail.splatRange![0]));
    const { memory } = scenes[0].place;
    const held = this.#reservation?.bytes ?? 0;
    // Buffers never become smaller.
    if (bytes <= held) return true;
    if (bytes > SHARE_OF_REST * (memory.budgetBytes - memory.bytes + held)) return false;
    this.#reservation?.release();
    this.#reservation = memory.reserve('frames of larger splat budgets', bytes);
    return true;
  }
}

function scaled({ detail: { splatBudget = 0, splatRange } }: BudgetedScene, factor: number): number {
  const [min, max] = splatRange ?? [splatBudget, splatBudget];
  return Math.min(max, Math.max(min, Math.floor(factor * splatBudget)));
}

function setBudget(scene: BudgetedScene, splatBudget: number): boolean {
  if (splatBudget === scene.detail.splatBudget) return false;
  scene.setDetail({ ...scene.detail, splatBudget });
  return true;
}
