import type { Vector3 } from '@gaussian-splat/core';
import { layouts } from '../generated/shaders.js';
import type { GaussianBlock } from '../gaussian-scene.js';
import { BUFFER_USAGE } from '../gpu/kernel.js';
import type { GpuMemory } from '../gpu/memory.js';
import { moveQuantizedSlots } from '../generated/quantized-shaders.js';
import { moveSlots } from '../generated/streamed-shaders.js';
import { Stage } from '../stages/stage.js';

/** Maximum number of slots that one submission translates. */
const MAX_MOVES = 256;
const MOVE_WORDS = layouts.SlotMove.size / 4;
const { by: BY, slot: SLOT } = layouts.SlotMove.fields;

/** Translates the positions of slots on the GPU. On the main thread this would cost as much time as the upload. */
export class SlotMover {
  readonly #device: GPUDevice;
  readonly #stage: Stage<typeof moveSlots | typeof moveQuantizedSlots>;
  readonly #pages: readonly { readonly moves: GPUBuffer; readonly bindings: GPUBindGroup }[];
  readonly #slotsPerBuffer: number;
  readonly #pending = new Map<number, Vector3>();

  constructor(
    device: GPUDevice,
    memory: GpuMemory,
    pages: readonly GaussianBlock[],
    { slotsPerBuffer, geometry }: { readonly slotsPerBuffer: number; readonly geometry?: 'quantized' },
  ) {
    this.#device = device;
    this.#stage = new Stage(device, geometry ? moveQuantizedSlots : moveSlots);
    this.#slotsPerBuffer = slotsPerBuffer;
    const usage = BUFFER_USAGE.storage | BUFFER_USAGE.copyDestination;
    this.#pages = pages.map(({ geometry }) => {
      const moves = memory.buffer('gs.pool.moves', 4 * MOVE_WORDS * MAX_MOVES, usage);
      return { moves, bindings: this.#stage.bind({ moves, gaussians: geometry }) };
    });
  }

  /** Whether no translation is pending. */
  get isEmpty(): boolean {
    return this.#pending.size === 0;
  }

  /** Whether no further translation can be added before {@link record}. */
  get isFull(): boolean {
    return this.#pending.size === MAX_MOVES;
  }

  /** Discards the pending translation of a slot that will be overwritten. */
  forget(slot: number): void {
    this.#pending.delete(slot);
  }

  /** Adds the translation of a filled slot, in world units. A translation by zero is ignored. */
  note(slot: number, by: Vector3): void {
    if (by.some((value) => value !== 0)) this.#pending.set(slot, by);
  }

  /** Records the pending translations. Submit the encoder before others are added. */
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
