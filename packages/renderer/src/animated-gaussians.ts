import { GaussianSplatError, type FilterRule, type ShDegree, type Vector3 } from '@gaussian-splat/core';
import type { GaussianBlock } from './gaussian-scene.js';
import * as layouts from './generated/clip-layouts.js';
import { animate } from './generated/clip-shaders.js';
import { constants } from './generated/shaders.js';
import { BUFFER_USAGE } from './gpu/kernel.js';
import { type GpuMemory, withMemoryCheck } from './gpu/memory.js';
import { writeStruct } from './gpu/struct.js';
import { submitPass } from './gpu/one-off.js';
import { bytesPerSplat } from './memory-ledger.js';
import { animationBytes, planeCodes, type PackedAnimation } from './pack/pack-animated.js';
import { SceneBuffers } from './scene-buffers.js';
import { Stage } from './stages/stage.js';
import { CHUNK_NUMBERS, GEOMETRY_WORDS, shWords } from './pack/words.js';

const { CULL_GROUP } = constants;
const PIECES = ['bases', 'sh', 'codes', 'curves'] as const;

interface PartRoom {
  readonly rows: number;
  readonly planes: number;
  readonly frames: number;
}

/** Size of the buffers of a clip: the largest sizes of each part over all its groups of frames. */
export interface AnimatedRoom extends FilterRule {
  /** Parts of a group in their order: splats, planes of codes, and frames. */
  readonly parts: readonly PartRoom[];
  /** Parts with the splats that all groups share, because they never change. Default: none. */
  readonly still?: readonly PartRoom[];
  readonly shDegree: ShDegree;
  readonly origin: Vector3;
  /** Factor that enlarges the splats of the first part while other parts are missing. */
  readonly grow: number;
  /** Upper limit of the GPU memory of the clip in bytes; default: no limit but the device's. */
  readonly memoryBudget?: number | undefined;
}

/** Buffers of a part in a slot, and the content that is uploaded to them. */
interface SlotPart {
  readonly buffers: Readonly<Record<(typeof PIECES)[number], GPUBuffer>>;
  readonly uniform: GPUBuffer;
  /** Values of the uniform: `Animate` of shaders/animate.wgsl. */
  readonly values: Uint32Array<ArrayBuffer>;
  readonly bindings: GPUBindGroup;
  /** Capacity in splats: a multiple of 256. */
  readonly rowRoom: number;
  /** Part that is being uploaded or has been uploaded; undefined if the slot is empty. */
  content: PackedAnimation | undefined;
  /** Number of bytes of `content` that are uploaded. */
  written: number;
}

/** Number of slots: one for the displayed group of frames, one for the next group. */
export const ANIMATION_SLOTS = 2;
/** Slot of the parts that never change, which are shown with the group of each other slot. */
export const STILL_SLOT = ANIMATION_SLOTS;
const FIELDS = layouts.Animate.fields;

/**
 * Gaussians of a clip. Each group of frames is uploaded once, and the GPU evaluates each frame. All buffers are created
 * at the start, so that playback allocates nothing.
 */
export class AnimatedGaussians extends SceneBuffers {
  readonly blocks: readonly GaussianBlock[];
  readonly #device: GPUDevice;
  readonly #stage: Stage<typeof animate>;
  readonly #slots: readonly (readonly SlotPart[])[];
  readonly #grow: number;
  #version = 0;
  #frameCount = 0;
  /** Number of still parts that were uploaded when they were evaluated last; -1 before, or if they were enlarged. */
  #stillShown = -1;

  private constructor(device: GPUDevice, memory: GpuMemory, room: AnimatedRoom) {
    const { parts, still = [] } = room;
    const [rooms, stillRooms] = [parts, still].map((own) => own.map(rowRoom));
    const groupRows = rooms.reduce((sum, rows) => sum + rows, 0);
    const count = stillRooms.reduce((sum, rows) => sum + rows, groupRows);
    super(memory, room, count);
    memory.reserve(whatOf(count), bytesOf(room, count), room.memoryBudget);
    this.#device = device;
    this.#grow = room.grow;
    this.#stage = new Stage(device, animate, constants.CULL_GROUP);
    const { storage, copySource } = BUFFER_USAGE;
    const part = (name: string, words: number): GPUBuffer =>
      memory.buffer(`gs.animate.${name}`, 4 * words, storage | copySource);
    const page = {
      count,
      geometry: part('geometry', GEOMETRY_WORDS * count),
      sh: part('sh', shWords(this.shDegree, this.shPrecision) * count),
      chunks: part('chunks', (CHUNK_NUMBERS * count) / CULL_GROUP),
    };
    this.blocks = [page];
    const slotOf = (own: readonly PartRoom[], ownRooms: readonly number[], begin: number): SlotPart[] => {
      let first = begin;
      return own.map((each, k) => {
        const slot = this.#slotPart(room, each, ownRooms[k], first);
        first += ownRooms[k];
        return slot;
      });
    };
    const groupSlots = Array.from({ length: ANIMATION_SLOTS }, () => slotOf(parts, rooms, 0));
    this.#slots = [...groupSlots, slotOf(still, stillRooms, groupRows)];
  }

  /**
   * Creates the buffers of a clip: two slots, each with capacity for the largest group.
   * @throws GaussianSplatError `out-of-memory/budget` before anything is allocated; `out-of-memory/buffer-limit` if a
   * part is larger than a binding of the device; `out-of-memory/allocation` if the device has too little memory.
   */
  static create(device: GPUDevice, room: AnimatedRoom): Promise<AnimatedGaussians> {
    return withMemoryCheck(device, 'a clip', (memory) => new AnimatedGaussians(device, memory, room));
  }

  get version(): number {
    return this.#version;
  }

  /** Number of splats of the displayed group that were uploaded when the frame was evaluated. */
  get frameCount(): number {
    return this.#frameCount;
  }

  /** Discards the content of a slot. */
  clear(slot: number): void {
    for (const part of this.#slots[slot]) part.content = undefined;
  }

  /** Whether all bytes of a part are uploaded to a slot. */
  isWritten(slot: number, part: number): boolean {
    const { content, written } = this.#slots[slot][part];
    return content !== undefined && written === sizeOf(content);
  }

  /**
   * Uploads a part to a slot. If the last call uploaded only the beginning of the same part, the upload continues after
   * it.
   * @param part Index of the part in its group.
   * @param max Upper limit of the bytes that this call uploads.
   * @returns Number of uploaded bytes.
   * @throws GaussianSplatError `argument/value` for a part that is larger than the buffers of the slot.
   */
  write(slot: number, part: number, content: PackedAnimation, max = Infinity): number {
    const to = this.#slots[slot][part];
    if (to.content !== content) {
      for (const name of PIECES)
        if (content[name].byteLength > to.buffers[name].size)
          throw tooLarge(name, to.buffers[name].size, content[name].byteLength);
      to.content = content;
      to.written = 0;
    }
    const begin = to.written;
    let at = 0;
    for (const name of PIECES) {
      const { buffer, byteOffset, byteLength } = content[name];
      const from = Math.max(0, to.written - at);
      const length = Math.min(byteLength - from, 4 * Math.floor((max - (to.written - begin)) / 4));
      if (length > 0) {
        this.#device.queue.writeBuffer(to.buffers[name], from, buffer, byteOffset + from, length);
        to.written += length;
      }
      at += byteLength;
    }
    return to.written - begin;
  }

  /**
   * Evaluates a frame of the group in a slot, from the parts that are completely uploaded. Subsequent submissions draw
   * this frame.
   * @param frame Index of the frame in its group.
   * @param isWhole False while parts of the group are missing: the splats of the uploaded parts are then enlarged.
   */
  show(slot: number, frame: number, isWhole: boolean): void {
    submitPass(this.#device, 'gs.animate', (pass) => this.#record(pass, slot, frame, isWhole ? 1 : this.#grow));
    this.#version++;
  }

  #record(pass: GPUComputePassEncoder, slot: number, frame: number, factor: number): void {
    this.#frameCount = 0;
    for (let k = 0; k < this.#slots[slot].length; k++) this.#evaluate(pass, slot, k, frame, factor);
    const still = this.#slots[STILL_SLOT];
    let written = 0;
    for (let k = 0; k < still.length; k++) if (this.isWritten(STILL_SLOT, k)) written++;
    // Evaluated splats remain until other parts are uploaded.
    const isShown = factor === 1 && written === this.#stillShown;
    for (let k = 0; k < still.length; k++) {
      if (isShown) this.#frameCount += this.isWritten(STILL_SLOT, k) ? still[k].content!.rows : 0;
      else this.#evaluate(pass, STILL_SLOT, k, 0, factor);
    }
    this.#stillShown = factor === 1 ? written : -1;
  }

  #evaluate(pass: GPUComputePassEncoder, slot: number, k: number, frame: number, factor: number): void {
    const part = this.#slots[slot][k];
    const content = this.isWritten(slot, k) ? part.content : undefined;
    this.#frameCount += content?.rows ?? 0;
    setValues(part.values, content, frame, factor);
    this.#device.queue.writeBuffer(part.uniform, 0, part.values);
    this.#stage.record(pass, part.bindings, part.rowRoom);
  }

  #slotPart({ shDegree }: AnimatedRoom, { rows, planes, frames }: PartRoom, ownRoom: number, first: number): SlotPart {
    const { storage, uniform, copyDestination } = BUFFER_USAGE;
    const sizes = animationBytes({ rows, planes, frames, shDegree });
    const buffer = (name: (typeof PIECES)[number]): GPUBuffer =>
      this.memory.buffer(`gs.animate.${name}`, sizes[name], storage | copyDestination);
    const buffers = { bases: buffer('bases'), sh: buffer('sh'), codes: buffer('codes'), curves: buffer('curves') };
    const values = new Uint32Array(layouts.Animate.size / 4);
    const nothing = { ranks: [0, 0, 0, 0], color_rank: 0, curve_count: 0, frame: 0, rows: 0, plane_codes: 0, grow: 1 };
    const plain = { turns_harmonics: 0, aged: [0, 0, 0, 0], color_aged: 0 };
    writeStruct(
      layouts.Animate,
      { ...nothing, ...plain, row_room: ownRoom, first_row: first, sh_degree: shDegree },
      values.buffer,
    );
    const own = this.memory.buffer('gs.animate.uniform', layouts.Animate.size, uniform | copyDestination);
    const [{ geometry, sh, chunks }] = this.blocks;
    const { bases, sh: base_sh, codes, curves } = buffers;
    const bindings = this.#stage.bind({ animate: own, bases, base_sh, codes, curves, gaussians: geometry, sh, chunks });
    return { buffers, uniform: own, values, bindings, rowRoom: ownRoom, content: undefined, written: 0 };
  }
}

const grow = new Float32Array(1);
const growBits = new Uint32Array(grow.buffer);

/**
 * Writes the uniform values of a part in place, so that a frame allocates nothing. `content` is undefined for a part
 * that is not uploaded: its `rows` are 0.
 */
function setValues(values: Uint32Array, content: PackedAnimation | undefined, frame: number, factor: number): void {
  grow[0] = factor;
  values[FIELDS.rows.offset / 4] = content?.rows ?? 0;
  values[FIELDS.frame.offset / 4] = frame;
  values[FIELDS.grow.offset / 4] = growBits[0];
  if (content === undefined) return;
  const { ranks, aged, rows } = content;
  for (let k = 0; k < 4; k++) {
    values[FIELDS.ranks.offset / 4 + k] = ranks[k];
    values[FIELDS.aged.offset / 4 + k] = aged[k];
  }
  values[FIELDS.color_rank.offset / 4] = ranks[4];
  values[FIELDS.color_aged.offset / 4] = aged[4];
  values[FIELDS.turns_harmonics.offset / 4] = content.turnsHarmonics ? 1 : 0;
  values[FIELDS.curve_count.offset / 4] = ranks[0] + ranks[1] + ranks[2] + ranks[3] + ranks[4];
  values[FIELDS.plane_codes.offset / 4] = planeCodes(rows);
}

const sizeOf = (content: PackedAnimation): number => PIECES.reduce((sum, name) => sum + content[name].byteLength, 0);

/** Returns the capacity of a part in splats. */
const rowRoom = ({ rows }: PartRoom): number => CULL_GROUP * Math.ceil(rows / CULL_GROUP);

function bytesOf({ parts, still = [], shDegree }: AnimatedRoom, count: number): number {
  const ofSlot = (own: readonly PartRoom[]): number =>
    own.reduce((total, each) => {
      const { bases, sh, codes, curves } = animationBytes({ ...each, shDegree });
      return total + bases + sh + codes + curves;
    }, 0);
  return ANIMATION_SLOTS * ofSlot(parts) + ofSlot(still) + count * bytesPerSplat(shDegree, 'float16');
}

const whatOf = (count: number): string => `clip of up to ${count} splats`;

const tooLarge = (name: string, expected: number, found: number): GaussianSplatError =>
  new GaussianSplatError('argument/value', {
    where: `AnimatedGaussians.write, ${name}`,
    expected: `at most ${expected} bytes`,
    found: `${found}`,
    remedy: 'create it with the capacity of the largest group',
  });
