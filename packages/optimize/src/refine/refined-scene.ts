import { shCoefficientCount, type GaussianCloud } from '@gaussian-splat/core';
import type { GaussianBlock } from '@gaussian-splat/renderer/tools';
import {
  BUFFER_USAGE,
  constants,
  type GpuMemory,
  ingestStage,
  Ingest,
  pageCapacity,
  recentered,
  SceneBuffers,
  withMemoryCheck,
  submitPass,
  uniformWith,
} from '@gaussian-splat/renderer/stages';
import { readBack } from '@gaussian-splat/renderer/tools';
import { LOGIT_AT, ROTATION_AT, SCALE_AT, SCREEN_BYTES, SCREEN_NUMBERS, SH_AT, SH_STEP } from '../generated/shaders.js';
import { pageOf } from '../gpu/cloud-buffers.js';
import type { ReducedCloud } from '../reduce.js';

const { CULL_GROUP, SHAPE_LOG_SCALE, COLOR_COEFFICIENT_MAJOR } = constants;
const FLOAT_BYTES = 4;
/** Largest magnitude of a logit, and smallest scale in world units: opacities 0 and 1 and scale 0 have no finite logarithm. */
const MAX_LOGIT = 15;
const MIN_SCALE = 1e-20;

/** A block of splats whose parameters are optimized. */
export interface RefinedPart {
  readonly page: GaussianBlock;
  /** Index of the part's first splat in `RefinedScene.screen`, a multiple of 256. */
  readonly first: number;
  /** Number of splats, rounded up to a multiple of 256: the stride between rows of `gradients` and `means`. */
  readonly row: number;
  /** array<f32>: parameters of each splat, in the layout of shaders/shared/refined.wgsl. */
  readonly numbers: GPUBuffer;
  /** array<u32>: the degree that each splat keeps. */
  readonly degrees: GPUBuffer;
  /** array<f32>: a row of derivatives for each optimized parameter. */
  readonly gradients: GPUBuffer;
  /** array<vec2f>: a row of Adam's running means, of derivatives and of their squares, for each optimized parameter. */
  readonly means: GPUBuffer;
  /** array<vec4f>: the largest curvatures of each splat in any view. */
  readonly bends: GPUBuffer;
  /** Bindings of the kernel that packs the part's parameters for the renderer. */
  readonly packing: GPUBindGroup;
}

/**
 * A scene on the GPU whose parameters are optimized. It holds float32 parameters for the optimizer and packed splats for
 * the renderer.
 */
export class RefinedScene extends SceneBuffers {
  readonly blocks: readonly GaussianBlock[];
  readonly parts: readonly RefinedPart[];
  /** array<vec2i>: SCREEN_NUMBERS fixed-point numbers of each splat. Each part takes {@link RefinedPart.row} splats. */
  readonly screen: GPUBuffer;
  readonly #device: GPUDevice;
  readonly #ingest: ReturnType<typeof ingestStage>;
  readonly #cloud: GaussianCloud;
  #version = 0;

  private constructor(
    device: GPUDevice,
    memory: GpuMemory,
    { cloud, degrees }: Omit<ReducedCloud, 'kept'>,
    max: number,
  ) {
    super(memory, cloud, cloud.count);
    this.#device = device;
    this.#cloud = cloud;
    this.#ingest = ingestStage(device);
    const { storage, copyDestination } = BUFFER_USAGE;
    const parts: RefinedPart[] = [];
    let first = 0;
    for (let begin = 0; begin < cloud.count; begin += max) {
      const part = this.#partOf(begin, Math.min(max, cloud.count - begin), first, degrees);
      first += part.row;
      parts.push(part);
    }
    this.parts = parts;
    this.blocks = parts.map(({ page }) => page);
    const bytes = SCREEN_BYTES * SCREEN_NUMBERS * Math.max(CULL_GROUP, first);
    this.screen = memory.buffer('gs.refine.screen', bytes, storage | copyDestination);
    submitPass(device, 'gs.refine.pack', (pass) => this.pack(pass));
  }

  /**
   * Uploads a reduced cloud. Each parameter of a splat takes 16 bytes of GPU memory. A splat of degree 3 takes about
   * 1.2 kB, including its packed form.
   * @throws GaussianSplatError `out-of-memory/*`
   */
  static async of(device: GPUDevice, reduced: Omit<ReducedCloud, 'kept'>): Promise<RefinedScene> {
    const sought = SH_STEP + 3 * shCoefficientCount(reduced.cloud.shDegree);
    const max = pageCapacity(device, 2 * FLOAT_BYTES * sought);
    const cloud = recentered(reduced.cloud);
    const where = `${cloud.count} splats to refine`;
    return withMemoryCheck(device, where, (memory) => new RefinedScene(device, memory, { ...reduced, cloud }, max));
  }

  get version(): number {
    return this.#version;
  }

  /** Records the packing of the parameters for the renderer. Call this after every change of the parameters. */
  pack(pass: GPUComputePassEncoder): void {
    for (const { packing, page } of this.parts) this.#ingest.record(pass, packing, page.count);
    this.#version++;
  }

  /** Reads the current parameters back from the GPU. Returns them as a cloud. */
  async read(): Promise<GaussianCloud> {
    const width = this.#width;
    const read = await readBack(
      this.#device,
      this.parts.map(({ numbers, page }) => ({ buffer: numbers, byteLength: FLOAT_BYTES * width * page.count })),
    );
    const [positions, scales, rotations] = [3, 3, 4].map((size) => new Float32Array(size * this.count));
    const opacities = new Float32Array(this.count);
    const sh = new Float32Array((width - SH_AT) * this.count);
    let i = 0;
    for (const bytes of read) {
      const numbers = new Float32Array(bytes);
      for (let at = 0; at < numbers.length; at += width, i++) {
        positions.set(numbers.subarray(at, at + 3), 3 * i);
        for (let k = 0; k < 3; k++) scales[3 * i + k] = Math.exp(numbers[at + SCALE_AT + k]);
        rotations.set(numbers.subarray(at + ROTATION_AT, at + LOGIT_AT), 4 * i);
        opacities[i] = 1 / (1 + Math.exp(-numbers[at + LOGIT_AT]));
        sh.set(numbers.subarray(at + SH_AT, at + width), (width - SH_AT) * i);
      }
    }
    return { ...this.#cloud, positions, scales, rotations, opacities, sh };
  }

  get #width(): number {
    return SH_AT + 3 * shCoefficientCount(this.shDegree);
  }

  #partOf(begin: number, count: number, first: number, degrees: Uint8Array): RefinedPart {
    const { storage, copySource, copyDestination } = BUFFER_USAGE;
    const row = CULL_GROUP * Math.ceil(count / CULL_GROUP);
    const sought = SH_STEP + this.#width - SH_AT;
    const buffer = (name: string, bytes: number, content?: Uint32Array): GPUBuffer =>
      this.memory.buffer(`gs.refine.${name}`, bytes, storage | copySource | copyDestination, content);
    const page = pageOf(this.memory, this.shDegree, count);
    const rows = numbersOf(this.#cloud, begin, count, this.#width);
    const numbers = buffer('numbers', rows.byteLength, new Uint32Array(rows.buffer));
    const packing = this.#ingest.bind({
      ingest: this.#ingestOf(count),
      ...{ positions: numbers, shapes: numbers, rotations: numbers, colors: numbers, opacities: numbers },
      ...{ gaussians: page.geometry, sh: page.sh, chunks: page.chunks },
    });
    return {
      ...{ page, first, row, numbers, packing },
      degrees: buffer('degrees', 4 * count, Uint32Array.from(degrees.subarray(begin, begin + count))),
      gradients: buffer('gradients', FLOAT_BYTES * sought * row),
      means: buffer('means', 2 * FLOAT_BYTES * sought * row),
      bends: buffer('bends', 4 * FLOAT_BYTES * row),
    };
  }

  /** Returns the uniforms `Ingest` of a part with `count` splats, whose parameters are rows in one buffer. */
  #ingestOf(count: number): GPUBuffer {
    const width = this.#width;
    return uniformWith(this.memory, 'gs.refine.ingest', Ingest, {
      ...{ count, rows: count, page_rows: count, first_row: 0, is_half: 0, is_w_first: 1, is_logit: 1 },
      ...{ shape_kind: SHAPE_LOG_SCALE, shape_numbers: 3 },
      ...{ color_kind: COLOR_COEFFICIENT_MAJOR, sh_degree: this.shDegree },
      ...{ positions: [0, width], shapes: [SCALE_AT, width], rotations: [ROTATION_AT, width] },
      ...{ colors: [SH_AT, width], opacities: [LOGIT_AT, width] },
    });
  }
}

/** Returns [count, width] parameters of `count` splats, from index `begin` on: logarithms of scales, logits of opacities. */
function numbersOf(cloud: GaussianCloud, begin: number, count: number, width: number): Float32Array<ArrayBuffer> {
  const rows = new Float32Array(width * count);
  for (let k = 0, at = 0; k < count; k++, at += width) {
    const i = begin + k;
    const opacity = cloud.opacities[i];
    const logit = Math.log(opacity / (1 - opacity));
    rows.set(cloud.positions.subarray(3 * i, 3 * i + 3), at);
    for (let axis = 0; axis < 3; axis++)
      rows[at + SCALE_AT + axis] = Math.log(Math.max(MIN_SCALE, cloud.scales[3 * i + axis]));
    rows.set(cloud.rotations.subarray(4 * i, 4 * i + 4), at + ROTATION_AT);
    rows[at + LOGIT_AT] = Math.min(MAX_LOGIT, Math.max(-MAX_LOGIT, logit));
    rows.set(cloud.sh.subarray((width - SH_AT) * i, (width - SH_AT) * (i + 1)), at + SH_AT);
  }
  return rows;
}
