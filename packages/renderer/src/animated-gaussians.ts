import { GaussianSplatError, type FilterRule, type ShDegree, type Vector3 } from '@gaussian-splat/core';
import type { GaussianBlock } from './gaussian-scene.js';
import * as layouts from './generated/clip-layouts.js';
import { animate } from './generated/clip-shaders.js';
import { constants } from './generated/shaders.js';
import { BUFFER_USAGE } from './gpu/kernel.js';
import { type GpuMemory, withMemoryCheck } from './gpu/memory.js';
import { writeStruct } from './gpu/struct.js';
import { bytesPerSplat } from './memory-ledger.js';
import { animationBytes, planeCodes, type PackedAnimation } from './pack/pack-animated.js';
import { SceneBuffers } from './scene-buffers.js';
import { Stage } from './stages/stage.js';
import { CHUNK_NUMBERS, GEOMETRY_WORDS, shWords } from './pack/words.js';

const { CULL_GROUP } = constants;
const PIECES = ['bases', 'sh', 'codes', 'curves'] as const;

/** Size of the buffers of a clip: the largest sizes of each part over all its groups of frames. */
export interface AnimatedRoom extends FilterRule {
  /** Parts of a group in their order: splats, planes of codes, and frames. */
  readonly parts: readonly { readonly rows: number; readonly planes: number; readonly frames: number }[];
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

  private constructor(device: GPUDevice, memory: GpuMemory, room: AnimatedRoom) {
    const rooms = room.parts.map(({ rows }) => CULL_GROUP * Math.ceil(rows / CULL_GROUP));
    const count = rooms.reduce((sum, rows) => sum + rows, 0);
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
    this.#slots = Array.from({ length: ANIMATION_SLOTS }, () => {
      let first = 0;
      return room.parts.map((own, k) => {
        const slot = this.#slotPart(room, own, rooms[k], first);
        first += rooms[k];
        return slot;
      });
    });
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

  /** Discards the content of a slot, 0 or 1. */
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
    const parts = this.#slots[slot];
    const encoder = this.#device.createCommandEncoder({ label: 'gs.animate' });
    const pass = encoder.beginComputePass({ label: 'gs.animate' });
    this.#frameCount = 0;
    parts.forEach((part, k) => {
      const content = this.isWritten(slot, k) ? part.content : undefined;
      this.#frameCount += content?.rows ?? 0;
      setValues(part.values, content, frame, isWhole ? 1 : this.#grow);
      this.#device.queue.writeBuffer(part.uniform, 0, part.values);
      this.#stage.record(pass, part.bindings, part.rowRoom);
    });
    pass.end();
    this.#device.queue.submit([encoder.finish()]);
    this.#version++;
  }

  #slotPart(
    { shDegree }: AnimatedRoom,
    { rows, planes, frames }: AnimatedRoom['parts'][number],
    rowRoom: number,
    first: number,
  ): SlotPart {
    const { storage, uniform, copyDestination } = BUFFER_USAGE;
    const sizes = animationBytes({ rows, planes, frames, shDegree });
    const buffer = (name: (typeof PIECES)[number]): GPUBuffer =>
      this.memory.buffer(`gs.animate.${name}`, sizes[name], storage | copyDestination);
    const buffers = { bases: buffer('bases'), sh: buffer('sh'), codes: buffer('codes'), curves: buffer('curves') };
    const values = new Uint32Array(layouts.Animate.size / 4);
    const nothing = { ranks: [0, 0, 0, 0], color_rank: 0, curve_count: 0, frame: 0, rows: 0, plane_codes: 0, grow: 1 };
    writeStruct(
      layouts.Animate,
      { ...nothing, row_room: rowRoom, first_row: first, sh_degree: shDegree },
      values.buffer,
    );
    const own = this.memory.buffer('gs.animate.uniform', layouts.Animate.size, uniform | copyDestination);
    const [{ geometry, sh, chunks }] = this.blocks;
    const { bases, sh: base_sh, codes, curves } = buffers;
    const bindings = this.#stage.bind({ animate: own, bases, base_sh, codes, curves, gaussians: geometry, sh, chunks });
    return { buffers, uniform: own, values, bindings, rowRoom, content: undefined, written: 0 };
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
  const { ranks, rows } = content;
  for (let k = 0; k < 4; k++) values[FIELDS.ranks.offset / 4 + k] = ranks[k];
  values[FIELDS.color_rank.offset / 4] = ranks[4];
  values[FIELDS.curve_count.offset / 4] = ranks[0] + ranks[1] + ranks[2] + ranks[3] + ranks[4];
  values[FIELDS.plane_codes.offset / 4] = planeCodes(rows);
}

const sizeOf = (content: PackedAnimation): number => PIECES.reduce((sum, name) => sum + content[name].byteLength, 0);

function bytesOf({ parts, shDegree }: AnimatedRoom, count: number): number {
  const ofSlot = parts.reduce((sum, own) => {
    const { bases, sh, codes, curves } = animationBytes({ ...own, shDegree });
    return sum + bases + sh + codes + curves;
  }, 0);
  return ANIMATION_SLOTS * ofSlot + count * bytesPerSplat(shDegree, 'float16');
}

const whatOf = (count: number): string => `clip of up to ${count} splats`;

const tooLarge = (name: string, expected: number, found: number): GaussianSplatError =>
  new GaussianSplatError('argument/value', {
    where: `AnimatedGaussians.write, ${name}`,
    expected: `at most ${expected} bytes`,
    found: `${found}`,
    remedy: 'create it with the capacity of the largest group',
  });
