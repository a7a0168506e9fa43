import { GaussianSplatError, type Vector3 } from '@gaussian-splat/core';
import type { GaussianPage } from '../gaussian-scene.js';
import { pageCapacity } from '../gaussian-buffers.js';
import { constants } from '../generated/shaders.js';
import { BUFFER_USAGE } from '../gpu/kernel.js';
import type { GpuMemory } from '../gpu/memory.js';
import { CHUNK_NUMBERS } from '../pack/chunks.js';
import { GEOMETRY_WORDS } from '../pack/pack.js';
import { shWords } from '../pack/sh.js';
import { DETAIL_NUMBERS } from './chunk-detail.js';
import { SLOT_CHUNKS, pageLayout, type PageFormat } from './manifest.js';
import type { PageList } from './page-list.js';
import { SlotMover } from './slot-mover.js';
import { chunkLayout, movePoints, numbersOf, startOf, type ChunkLayout, type SlotWords } from './slot-words.js';

const SLOT_SPLATS = SLOT_CHUNKS * constants.CULL_GROUP;
/** Largest buffer of a pool, in bytes: several of this size are found where one large one is not (iOS). */
const LARGEST_BUFFER = 1 << 27;

/** Bytes of GPU memory that one slot takes. */
export function slotBytes(format: PageFormat): number {
  return 4 * pageLayout(format, SLOT_CHUNKS).total;
}

/**
 * Slots of which so many bytes are enough, and no more than the pages take.
 * @throws GaussianSplatError `out-of-memory/budget` if the first page does not fit.
 */
export function slotsFor(format: PageFormat, list: PageList, budget: number): number {
  const all = list.slots.reduce((sum, slots) => sum + slots, 0);
  const slots = Math.min(all, Math.floor(budget / slotBytes(format)));
  if (slots >= list.slots[0]) return slots;
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

  constructor(device: GPUDevice, memory: GpuMemory, format: PageFormat, slots: number) {
    this.#device = device;
    this.#layout = chunkLayout(format);
    const stride = shWords(format.shDegree, format.shPrecision);
    const bytes = 4 * Math.max(GEOMETRY_WORDS, stride);
    const capacity = Math.min(pageCapacity(device, bytes), Math.floor(LARGEST_BUFFER / bytes));
    this.slotsPerBuffer = Math.max(1, Math.floor(capacity / SLOT_SPLATS));
    const usage = BUFFER_USAGE.storage | BUFFER_USAGE.copyDestination | BUFFER_USAGE.copySource;
    const buffer = (name: string, words: number): GPUBuffer => memory.buffer(`gs.pool.${name}`, 4 * words, usage);
    this.pages = Array.from({ length: Math.ceil(slots / this.slotsPerBuffer) }, (_, p) => {
      const own = Math.min(this.slotsPerBuffer, slots - p * this.slotsPerBuffer);
      return {
        count: SLOT_SPLATS * own,
        geometry: buffer('geometry', GEOMETRY_WORDS * SLOT_SPLATS * own),
        sh: buffer('sh', stride * SLOT_SPLATS * own),
        chunks: buffer('chunks', CHUNK_NUMBERS * SLOT_CHUNKS * own),
        details: buffer('details', DETAIL_NUMBERS * SLOT_CHUNKS * own),
      };
    });
    this.#mover = new SlotMover(device, memory, this.pages, this.slotsPerBuffer);
  }

  /**
   * Puts chunks into a slot, straight from the file that they lie in: a copy costs the thread more than all else. Their details are written by {@link writeDetails}; {@link flush} must
   * follow before the slot is drawn.
   * @param by world units, added to all positions
   */
  write(slot: number, words: SlotWords, by: Vector3): void {
    const { page, place } = this.#find(slot);
    const { queue } = this.#device;
    const layout = this.#layout;
    const first = SLOT_CHUNKS * place;
    const boxes = this.#boxes;
    boxes.set(numbersOf(words, 'chunks', layout));
    const end = CHUNK_NUMBERS * words.chunks;
    for (let corner = 0; corner < CHUNK_NUMBERS; corner += 4) movePoints(boxes, corner, end, CHUNK_NUMBERS, by);
    queue.writeBuffer(page.chunks, 4 * CHUNK_NUMBERS * first, boxes, 0, end);
    for (const part of ['geometry', 'sh'] as const) {
      const from = startOf(words, part, layout);
      queue.writeBuffer(page[part], 4 * layout[part] * first, words.words, from, layout[part] * words.chunks);
    }
    this.#mover.note(slot, by);
  }

  /** Submits what is left to do for slots that were written. */
  flush(): void {
    this.#mover.flush();
  }

  /** Writes detail rows, {@link SLOT_CHUNKS} for each slot from the given one on; all of them lie in one buffer. */
  writeDetails(first: number, rows: Float32Array<ArrayBuffer>): void {
    const { page, place } = this.#find(first);
    this.#device.queue.writeBuffer(page.details!, 4 * DETAIL_NUMBERS * SLOT_CHUNKS * place, rows);
  }

  #find(slot: number): { page: GaussianPage; place: number } {
    return { page: this.pages[Math.floor(slot / this.slotsPerBuffer)], place: slot % this.slotsPerBuffer };
  }
}
