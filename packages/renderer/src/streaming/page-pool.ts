import { GaussianSplatError, type Vector3 } from '@gaussian-splat/core';
import type { GaussianPage } from '../gaussian-scene.js';
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
/** Largest buffer of a pool, in bytes: several of this size are found where one large one is not (iOS). */
const LARGEST_BUFFER = 1 << 27;
/** Of what a pool may take, a share for uploads to pass through, and the most bytes that serve: with so many one in a hundred found no room where frames upload all they may. */
const STAGING = { share: 1 / 32, most: 24e6 } as const;

/** Bytes of GPU memory that one slot takes. */
export function slotBytes(format: PageFormat): number {
  return 4 * pageLayout(format, SLOT_CHUNKS).total;
}

/** What a pool consists of. */
export interface PoolSize {
  readonly slots: number;
  /** Blocks of mapped memory that uploads pass through. */
  readonly blocks: number;
}

/** Bytes of GPU memory that slots and blocks take. */
export const poolBytes = (format: PageFormat, { slots, blocks }: PoolSize): number =>
  slots * slotBytes(format) + blocks * BLOCK_BYTES;

/**
 * A pool for which so many bytes are enough, of no more slots than the pages take.
 * @throws GaussianSplatError `out-of-memory/budget` if the first page does not fit.
 */
export function poolSize(format: PageFormat, list: PageList, budget: number): PoolSize {
  const all = list.slots.reduce((sum, slots) => sum + slots, 0);
  const bytes = Math.min(budget, all * slotBytes(format));
  const blocks = Math.floor(Math.min(STAGING.most, STAGING.share * bytes) / BLOCK_BYTES);
  const slots = Math.min(all, Math.floor((budget - blocks * BLOCK_BYTES) / slotBytes(format)));
  if (slots >= list.slots[0]) return { slots, blocks };
  throw new GaussianSplatError('out-of-memory/budget', {
    where: 'streamed scene',
    expected: `at least ${list.slots[0] * slotBytes(format)} bytes of GPU memory for one page`,
    found: `${Math.floor(budget)} bytes (memoryBudget)`,
    remedy: 'raise the budget',
  });
}

/** Slots on the GPU, allocated once, each with room for one page of a streamed scene or a part of it. What is in a slot without page is never drawn. */
export class PagePool {
  readonly pages: readonly GaussianPage[];
  readonly #device: GPUDevice;
  readonly #layout: ChunkLayout;
  /** Boxes of the chunks of the slot that is written. */
  readonly #boxes = new Float32Array(CHUNK_NUMBERS * SLOT_CHUNKS);
  /** Slots that lie in one buffer. */
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
   * Puts chunks into a slot, straight from the file that they lie in: another copy would cost the thread as much again. Their details are written by {@link writeDetails};
   * {@link flush} must follow before the slot is drawn.
   * @param by world units, added to all positions
   */
  write(slot: number, words: SlotWords, by: Vector3): void {
    const { page, place } = this.#find(slot);
    // Part of it may be submitted before all of it has been written.
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

  /** Writes detail rows, {@link SLOT_CHUNKS} for each slot from the given one on; all of them lie in one buffer. {@link flush} must follow. */
  writeDetails(first: number, rows: Float32Array<ArrayBuffer>): void {
    const { page, place } = this.#find(first);
    this.#write(page.details!, 4 * DETAIL_NUMBERS * SLOT_CHUNKS * place, wordsOf(rows));
  }

  /** Submits what has been written. */
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
    // What has been written before must not come later than this.
    this.flush();
    this.#device.queue.writeBuffer(to, at + 4 * taken, words, taken);
  }

  #find(slot: number): { page: GaussianPage; place: number } {
    return { page: this.pages[Math.floor(slot / this.slotsPerBuffer)], place: slot % this.slotsPerBuffer };
  }
}

const wordsOf = ({ buffer, byteOffset, length }: Float32Array<ArrayBuffer>): Uint32Array<ArrayBuffer> =>
  new Uint32Array(buffer, byteOffset, length);
