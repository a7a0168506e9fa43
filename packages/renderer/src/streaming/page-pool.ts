import { GaussianSplatError, type Vector3 } from '@gaussian-splat/core';
import type { GaussianBlock } from '../gaussian-scene.js';
import { pageCapacity } from '../gaussian-buffers.js';
import { constants } from '../generated/shaders.js';
import { BUFFER_USAGE } from '../gpu/kernel.js';
import type { GpuMemory } from '../gpu/memory.js';
import { BLOCK_BYTES, StagingBelt } from '../gpu/staging-belt.js';
import { DETAIL_NUMBERS } from '../levels/chunk-detail.js';
import { SLOT_CHUNKS, pageLayout, type PageFormat } from './manifest.js';
import type { PageList } from './page-list.js';
import { QUANTIZED } from './quantized-reading.js';
import { SlotMover } from './slot-mover.js';
import { chunkLayout, movePoints, numbersOf, startOf, type ChunkLayout, type SlotWords } from './slot-words.js';
import { CHUNK_NUMBERS } from '../pack/words.js';

const SLOT_SPLATS = SLOT_CHUNKS * constants.CULL_GROUP;
/**
 * Maximum size of a pool's buffer in bytes. Several buffers of this size can be allocated when a single larger one
 * cannot (iOS).
 */
const LARGEST_BUFFER = 1 << 27;
/**
 * Fraction of the pool's memory for staging uploads, and its upper limit in bytes. At the maximum upload rate, one
 * frame in a hundred lacked staging memory with this limit.
 */
const STAGING = { share: 1 / 32, max: 24e6 } as const;

/** Returns the size of one slot in GPU memory, in bytes. */
export function slotBytes(format: PageFormat): number {
  return 4 * pageLayout(format, SLOT_CHUNKS).total;
}

/** Number of slots and staging blocks of a pool. */
export interface PoolSize {
  readonly slots: number;
  /** Number of staging blocks of mapped memory. */
  readonly blocks: number;
}

/** Returns the size of the slots and staging blocks in GPU memory, in bytes. */
export const poolBytes = (format: PageFormat, { slots, blocks }: PoolSize): number =>
  slots * slotBytes(format) + blocks * BLOCK_BYTES;

/**
 * Returns the largest pool within a budget in bytes, with at most as many slots as all pages need.
 * @throws GaussianSplatError `out-of-memory/budget` if the first page does not fit.
 */
export function poolSize(format: PageFormat, list: PageList, budget: number): PoolSize {
  const all = list.maxSlots ?? list.slots.reduce((sum, slots) => sum + slots, 0);
  const bytes = Math.min(budget, all * slotBytes(format));
  const blocks = Math.floor(Math.min(STAGING.max, STAGING.share * bytes) / BLOCK_BYTES);
  const slots = Math.min(all, Math.floor((budget - blocks * BLOCK_BYTES) / slotBytes(format)));
  if (slots >= list.slots[0]) return { slots, blocks };
  throw new GaussianSplatError('out-of-memory/budget', {
    where: 'streamed scene',
    expected: `at least ${list.slots[0] * slotBytes(format)} bytes of GPU memory for one page`,
    found: `${Math.floor(budget)} bytes (memoryBudget)`,
    remedy: 'raise the budget',
  });
}

/**
 * Slots on the GPU, allocated once. Each slot contains a page of a streamed scene or a part of one. The content of a
 * slot without a page is never drawn.
 */
export class PagePool {
  readonly pages: readonly GaussianBlock[];
  readonly #device: GPUDevice;
  readonly #layout: ChunkLayout;
  /** Boxes of the chunks in the slot that is being written. */
  readonly #boxes = new Float32Array(CHUNK_NUMBERS * SLOT_CHUNKS);
  /** Number of slots in one buffer. */
  readonly slotsPerBuffer: number;
  readonly #mover: SlotMover;
  readonly #belt: StagingBelt;

  constructor(device: GPUDevice, memory: GpuMemory, format: PageFormat, { slots, blocks }: PoolSize) {
    this.#device = device;
    this.#layout = chunkLayout(format);
    const slot = pageLayout(format, SLOT_CHUNKS);
    const bytes = (4 * Math.max(slot.geometry, slot.sh)) / SLOT_SPLATS;
    const capacity = Math.min(pageCapacity(device, bytes), Math.floor(LARGEST_BUFFER / bytes));
    this.slotsPerBuffer = Math.max(1, Math.floor(capacity / SLOT_SPLATS));
    const usage = BUFFER_USAGE.storage | BUFFER_USAGE.copyDestination | BUFFER_USAGE.copySource;
    const buffer = (name: string, words: number): GPUBuffer => memory.buffer(`gs.pool.${name}`, 4 * words, usage);
    this.pages = Array.from({ length: Math.ceil(slots / this.slotsPerBuffer) }, (_, p) => {
      const own = Math.min(this.slotsPerBuffer, slots - p * this.slotsPerBuffer);
      return {
        count: SLOT_SPLATS * own,
        reading: format.geometry && QUANTIZED,
        geometry: buffer('geometry', slot.geometry * own),
        sh: buffer('sh', slot.sh * own),
        chunks: buffer('chunks', slot.chunks * own),
        details: buffer('details', slot.details * own),
      };
    });
    const { slotsPerBuffer } = this;
    this.#mover = new SlotMover(device, memory, this.pages, { slotsPerBuffer, geometry: format.geometry });
    this.#belt = new StagingBelt(memory, 'gs.pool.staging', blocks);
  }

  /**
   * Writes chunks to a slot, directly from the words of their file, because another copy would cost as much time again.
   * Write their LOD rows with {@link writeDetails}, and call {@link flush} before the slot is drawn.
   * @param by Translation in world units, added to all positions.
   */
  write(slot: number, words: SlotWords, by: Vector3): void {
    const { page, place } = this.#find(slot);
    // A part of these writes may be submitted before the others, so an earlier translation must not run on it.
    this.#mover.forget(slot);
    const layout = this.#layout;
    const first = SLOT_CHUNKS * place;
    const boxes = this.#boxes;
    boxes.set(numbersOf(words, 'chunks', layout));
    const end = CHUNK_NUMBERS * words.chunks;
    for (let corner = 0; corner < CHUNK_NUMBERS; corner += 4) movePoints(boxes, corner, end, CHUNK_NUMBERS, by);
    this.#write(page.chunks, 4 * CHUNK_NUMBERS * first, wordsOf(boxes).subarray(0, end));
    for (const part of ['geometry', 'sh'] as const) {
      const from = startOf(words, part, layout);
      this.#write(page[part], 4 * layout[part] * first, words.words.subarray(from, from + layout[part] * words.chunks));
    }
    this.#mover.note(slot, by);
    if (this.#mover.isFull) this.flush();
  }

  /**
   * Writes LOD rows of consecutive slots, {@link SLOT_CHUNKS} for each slot. All slots must be in one buffer. Call
   * {@link flush} afterwards.
   * @param first Index of the first slot.
   */
  writeDetails(first: number, rows: Float32Array<ArrayBuffer>): void {
    const { page, place } = this.#find(first);
    this.#write(page.details!, 4 * DETAIL_NUMBERS * SLOT_CHUNKS * place, wordsOf(rows));
  }

  /** Submits all writes and translations. */
  flush(): void {
    if (this.#belt.isEmpty && this.#mover.isEmpty) return;
    const encoder = this.#device.createCommandEncoder({ label: 'gs.pool' });
    this.#belt.record(encoder);
    this.#mover.record(encoder);
    this.#device.queue.submit([encoder.finish()]);
    this.#belt.recall();
  }

  #write(to: GPUBuffer, at: number, words: Uint32Array<ArrayBuffer>): void {
    const taken = this.#belt.write(to, at, words);
    if (taken === words.length) return;
    // Without staging memory the write goes to the queue, after all earlier writes.
    this.flush();
    this.#device.queue.writeBuffer(to, at + 4 * taken, words, taken);
  }

  #find(slot: number): { page: GaussianBlock; place: number } {
    return { page: this.pages[Math.floor(slot / this.slotsPerBuffer)], place: slot % this.slotsPerBuffer };
  }
}

const wordsOf = ({ buffer, byteOffset, length }: Float32Array<ArrayBuffer>): Uint32Array<ArrayBuffer> =>
  new Uint32Array(buffer, byteOffset, length);
