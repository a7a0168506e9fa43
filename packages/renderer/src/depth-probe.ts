import type { FrameBindings, Stages } from './bindings.js';
import { recordSurvivors } from './frame.js';
import { probeDepth, probeSurface, probeSurfaceQuantized } from './generated/probe-shaders.js';
import { layouts } from './generated/shaders.js';
import { BUFFER_USAGE, kernelOf, type ShaderDescription } from './gpu/kernel.js';
import { GpuMemory } from './gpu/memory.js';
import { readBack } from './gpu/read-back.js';
import { Stage } from './stages/stage.js';
import type { ProbedSplat } from './probed-splat.js';

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
   * Depth along the camera's axis, in world units, of the visible surface: at which the splat is densest, along the ray of the point, behind which less than half
   * of the light is left. Null if the splats let more than half of it pass.
   */
  readonly depth: number | null;
  /** The same for 90 % of the light: the first thing that is noticeable. Null if more passes. */
  readonly near: number | null;
  /** The same for 10 % of the light. Null if more passes. `far - near` tells how thick the surface is. */
  readonly far: number | null;
  /** 0..1: light that the splats in front of the point's own depth let pass. 1: nothing hides it. */
  readonly transmittance: number;
  /** The splat that {@link ProbeAnswer.depth} is of. Null where that is, and where something else than a splat is nearer. */
  readonly splat: ProbedSplat | null;
}

/** The frame to look into. */
export interface ProbeSource {
  readonly stages: Stages;
  readonly bindings: FrameBindings;
}

/** Opacity and depth under single points of the last frame; a workgroup a point. */
export const probeDepthStage = (device: GPUDevice): Stage<typeof probeDepth> => new Stage(device, probeDepth);

const { storage, copySource, copyDestination } = BUFFER_USAGE;
const WORDS_PER_ANSWER = layouts.ProbeAnswer.size / 4;
/** Word of an answer with the number of the splat of its middle depth. */
const STORED_AT = layouts.ProbeAnswer.fields.stored.offset / 4 + 1;

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
    const { plan, splats, order } = source.bindings.scratch;
    // The list of survivors, which the surfaces need, takes the place of the order for a moment.
    const kept = memory.buffer('gs.probe_depth.order', order[0].size, copySource | copyDestination);
    const stage = probeDepthStage(device);
    const encoder = device.createCommandEncoder({ label: 'gs.probe_depth' });
    const pass = encoder.beginComputePass({ label: 'gs.probe_depth' });
    stage.record(pass, stage.bind({ plan, splats, order: order[0], points: asked, answers }), points.length);
    pass.end();
    encoder.copyBufferToBuffer(order[0], 0, kept, 0, kept.size);
    const surfaces = encoder.beginComputePass({ label: 'gs.probe_surface' });
    recordSurvivors(surfaces, source);
    recordSurfaces(device, surfaces, source.bindings, { points: asked, answers, count: points.length });
    surfaces.end();
    encoder.copyBufferToBuffer(kept, 0, order[0], 0, kept.size);
    const [found] = await readBack(device, [{ buffer: answers }], encoder);
    return readAnswers(found, points.length, (stored) => source.bindings.table.splatAt(stored));
  } finally {
    memory.destroy();
  }
}

/** Either of the two shaders. */
type SurfaceShader = ShaderDescription & Pick<typeof probeSurface, 'bindings'>;

/** Replaces depths of centers by those of surfaces, page after page. */
function recordSurfaces(
  device: GPUDevice,
  pass: GPUComputePassEncoder,
  { table, scratch }: FrameBindings,
  { points, answers, count }: { points: GPUBuffer; answers: GPUBuffer; count: number },
): void {
  const { order, plan } = scratch;
  table.pages.forEach((page, i) => {
    const plain = page.reading ? probeSurfaceQuantized : probeSurface;
    const kernel = kernelOf<SurfaceShader>(device, table.readingOf(i)?.probeSurface ?? plain);
    const bound = { view: table.view(i), gaussians: page.geometry, survivors: order[0], plan, points, answers };
    const group = kernel.bind({ ...table.modifiersOf(i), ...bound });
    kernel.dispatch(pass, group, count);
  });
}

function readAnswers(found: ArrayBuffer, points: number, splatOf: (stored: number) => ProbedSplat): ProbeAnswer[] {
  const [values, words] = [new Float32Array(found), new Uint32Array(found)];
  return Array.from({ length: points }, (_, i) => {
    const at = i * WORDS_PER_ANSWER;
    const [near, depth, far, opacity, , , , transmittance] = values.subarray(at);
    const [nearest, surface, farthest] = [near, depth, far].map((value) => (value > 0 ? value : null));
    const stored = words[at + STORED_AT];
    const splat = surface === null || stored === 0 ? null : splatOf(stored - 1);
    return { opacity, depth: surface, near: nearest, far: farthest, transmittance, splat };
  });
}

/** WGSL may assume that there are no infinities. */
const LARGEST_FLOAT32 = 3.4e38;
const finite = (value: number): number => Math.min(LARGEST_FLOAT32, Math.max(-LARGEST_FLOAT32, value));
