import type { Vector3 } from '@gaussian-splat/core';
import { layouts } from '../generated/shaders.js';
import type { GaussianPage } from '../gaussian-scene.js';
import { BUFFER_USAGE } from '../gpu/kernel.js';
import type { GpuMemory } from '../gpu/memory.js';
import { moveQuantizedSlots } from '../generated/quantized-shaders.js';
import { moveSlots } from '../generated/streamed-shaders.js';
import { Stage } from '../stages/stage.js';

/** Slots that are moved in one submission. */
const MOST_MOVES = 256;
const MOVE_WORDS = layouts.SlotMove.size / 4;
const { by: BY, slot: SLOT } = layouts.SlotMove.fields;

/** Moves what was written into slots, on the GPU: reading and writing it on the page's thread would cost that as much as the upload. */
export class SlotMover {
  readonly #device: GPUDevice;
  readonly #stage: Stage<typeof moveSlots | typeof moveQuantizedSlots>;
  readonly #pages: readonly { readonly moves: GPUBuffer; readonly bindings: GPUBindGroup }[];
  readonly #slotsPerBuffer: number;
  readonly #pending = new Map<number, Vector3>();

  constructor(
    device: GPUDevice,
    memory: GpuMemory,
    pages: readonly GaussianPage[],
    { slotsPerBuffer, geometry }: { readonly slotsPerBuffer: number; readonly geometry?: 'quantized' },
  ) {
    this.#device = device;
    this.#stage = new Stage(device, geometry ? moveQuantizedSlots : moveSlots);
    this.#slotsPerBuffer = slotsPerBuffer;
    const usage = BUFFER_USAGE.storage | BUFFER_USAGE.copyDestination;
    this.#pages = pages.map(({ geometry }) => {
      const moves = memory.buffer('gs.pool.moves', 4 * MOVE_WORDS * MOST_MOVES, usage);
      return { moves, bindings: this.#stage.bind({ moves, gaussians: geometry }) };
    });
  }

  /** Nothing is to be moved. */
  get isEmpty(): boolean {
    return this.#pending.size === 0;
  }

  /** No other slot must be noted before {@link record}. */
  get isFull(): boolean {
    return this.#pending.size === MOST_MOVES;
  }

  /** What is in a slot is about to be overwritten. */
  forget(slot: number): void {
    this.#pending.delete(slot);
  }

  /** A slot has been filled, with what belongs elsewhere by so much. */
  note(slot: number, by: Vector3): void {
    if (by.some((value) => value !== 0)) this.#pending.set(slot, by);
  }

  /** Records the moves of what has been noted, to be submitted before anything else is noted. */
  record(encoder: GPUCommandEncoder): void {
    if (this.isEmpty) return;
    const pass = encoder.beginComputePass({ label: 'gs.pool.move' });
    this.#pages.forEach(({ moves, bindings }, page) => {
      const own = [...this.#pending].filter(([slot]) => Math.floor(slot / this.#slotsPerBuffer) === page);
      if (own.length === 0) return;
      this.#device.queue.writeBuffer(moves, 0, this.#pack(own));
      this.#stage.record(pass, bindings, own.length);
    });
    pass.end();
    this.#pending.clear();
  }

  #pack(moves: readonly (readonly [number, Vector3])[]): Uint32Array<ArrayBuffer> {
    const words = new Uint32Array(MOVE_WORDS * moves.length);
    const floats = new Float32Array(words.buffer);
    moves.forEach(([slot, by], k) => {
      floats.set(by, MOVE_WORDS * k + BY.offset / 4);
      words[MOVE_WORDS * k + SLOT.offset / 4] = slot % this.#slotsPerBuffer;
    });
    return words;
  }
}
