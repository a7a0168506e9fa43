import { probeDepth } from './generated/probe-shaders.js';
import { layouts } from './generated/shaders.js';
import { BUFFER_USAGE, kernelOf, type ComputeKernel, type Resources } from './gpu/kernel.js';
import { GpuMemory } from './gpu/memory.js';

/** A point of the image that was drawn last. */
export interface ProbePoint {
  /** Pixels from the image's left edge; pixel centres at +0.5. */
  readonly x: number;
  /** Pixels from its top. */
  readonly y: number;
  /** Depth along the camera's axis in world units, for {@link ProbeAnswer.transmittance}; default: beyond everything. */
  readonly depth?: number;
}

/** What the splats do to the light that comes through a point. */
export interface ProbeAnswer {
  /** 0..1: how opaque the image is there. */
  readonly opacity: number;
  /**
   * Depth along the camera's axis, in world units and to 11 bits, of the splat behind which less than half of the light is left:
   * the visible surface. Null where the splats let more than half of it pass.
   */
  readonly depth: number | null;
  /** 0..1: light that the splats in front of the point's own depth let pass. 1: nothing hides it. */
  readonly transmittance: number;
}

/** The frame to look into: where it lies on the GPU. */
export interface ProbeSource {
  readonly plan: GPUBuffer;
  readonly splats: GPUBuffer;
  /** Slots from near to far. */
  readonly order: GPUBuffer;
}

/** Opacity and depth under single points of the last frame; a workgroup a point. */
export class ProbeDepthStage {
  readonly #kernel: ComputeKernel<typeof probeDepth>;

  constructor(device: GPUDevice) {
    this.#kernel = kernelOf(device, probeDepth);
  }

  bind(resources: Resources<typeof probeDepth>): GPUBindGroup {
    return this.#kernel.bind(resources);
  }

  record(pass: GPUComputePassEncoder, bindings: GPUBindGroup, points: number): void {
    this.#kernel.dispatch(pass, bindings, points);
  }
}

const { storage, copySource, copyDestination, mapRead } = BUFFER_USAGE;
const WORDS_PER_ANSWER = layouts.ProbeAnswer.size / 4;

/**
 * Looks into the frame that was drawn last, whatever rasterizer drew it. Reads back: for clicks and labels, not for every frame.
 */
export async function probe(
  device: GPUDevice,
  source: ProbeSource,
  points: readonly ProbePoint[],
): Promise<ProbeAnswer[]> {
  if (points.length === 0) return [];
  const memory = new GpuMemory(device);
  try {
    const words = new Float32Array(points.flatMap(({ x, y, depth }) => [x, y, depth ?? Infinity, 0]).map(finite));
    const bytes = points.length * layouts.ProbeAnswer.size;
    const asked = memory.buffer('gs.probe_depth.points', words.byteLength, storage, new Uint32Array(words.buffer));
    const answers = memory.buffer('gs.probe_depth.answers', bytes, storage | copySource);
    const staging = memory.buffer('gs.probe_depth.staging', bytes, mapRead | copyDestination);
    const stage = new ProbeDepthStage(device);
    const encoder = device.createCommandEncoder({ label: 'gs.probe_depth' });
    const pass = encoder.beginComputePass({ label: 'gs.probe_depth' });
    stage.record(pass, stage.bind({ ...source, points: asked, answers }), points.length);
    pass.end();
    encoder.copyBufferToBuffer(answers, 0, staging, 0, bytes);
    device.queue.submit([encoder.finish()]);
    await staging.mapAsync(0x1);
    return readAnswers(new Float32Array(staging.getMappedRange().slice(0)), points.length);
  } finally {
    memory.destroy();
  }
}

function readAnswers(values: Float32Array, count: number): ProbeAnswer[] {
  return Array.from({ length: count }, (_, i) => {
    const [opacity, depth, transmittance] = values.subarray(i * WORDS_PER_ANSWER, (i + 1) * WORDS_PER_ANSWER);
    return { opacity, depth: depth > 0 ? depth : null, transmittance };
  });
}

/** WGSL may assume that there are no infinities. */
const LARGEST_FLOAT32 = 3.4e38;
const finite = (value: number): number => Math.min(LARGEST_FLOAT32, Math.max(-LARGEST_FLOAT32, value));
