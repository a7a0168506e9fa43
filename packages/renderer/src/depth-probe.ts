import type { FrameBindings, Stages } from './bindings.js';
import { recordSurvivors } from './frame.js';
import { probeDepth, probeSurface, probeSurfaceQuantized } from './generated/probe-shaders.js';
import { constants, layouts } from './generated/shaders.js';
import { BUFFER_USAGE, kernelOf, type ShaderDescription } from './gpu/kernel.js';
import { GpuMemory } from './gpu/memory.js';
import { readBack } from './gpu/read-back.js';
import { Stage } from './stages/stage.js';
import { depthsOf } from './probe-depths.js';
import type { ProbedSplat } from './probed-splat.js';

/** A point of the last drawn image to probe. */
export interface ProbePoint {
  /** Pixels from the left edge of the image; pixel centers are at +0.5. */
  readonly x: number;
  /** Pixels from the top edge of the image. */
  readonly y: number;
  /**
   * Depth along the optical axis in world units, up to which {@link ProbeAnswer.transmittance} counts splats. Default:
   * behind all splats.
   */
  readonly depth?: number;
}

/** Transmittance and depths of the splats along the ray of a point. */
export interface ProbeAnswer {
  /** Opacity of the image at the point, 0..1. */
  readonly opacity: number;
  /**
   * Depth of the visible surface along the optical axis, in world units. The surface is the first splat behind which
   * less than half of the light is left. Its depth is the one of its highest density on the ray. Null if the splats
   * transmit half of the light or more.
   */
  readonly depth: number | null;
  /**
   * Depth of the first noticeable splat: like {@link depth}, but less than 90 % of the light is left. Null if more is
   * transmitted.
   */
  readonly near: number | null;
  /**
   * Depth of the back of the surface: like {@link depth}, but less than 10 % of the light is left. Null if more is
   * transmitted. `far - near` is the thickness of the surface.
   */
  readonly far: number | null;
  /**
   * [16] depths like {@link depth}, behind which less than 0.9, 0.8, ... 0.1 of the light is left, then 0.05 and its
   * halves. 0 if more is transmitted.
   */
  readonly layers: Float32Array;
  /** Standard deviation of the splat at {@link depth} along the ray, in world units; 0 if there is none. */
  readonly thickness: number;
  /** Transmittance, 0..1, of the splats in front of {@link ProbePoint.depth}. 1 if nothing hides this depth. */
  readonly transmittance: number;
  /** The splat at {@link ProbeAnswer.depth}. Null if there is no such depth, or if a mesh is nearer. */
  readonly splat: ProbedSplat | null;
}

/** Stages and bindings of the frame to probe. */
export interface ProbeSource {
  readonly stages: Stages;
  readonly bindings: FrameBindings;
}

/**
 * Returns the stage that finds opacity and depth at single points of the last frame, with one workgroup for each point.
 */
export const probeDepthStage = (device: GPUDevice): Stage<typeof probeDepth> => new Stage(device, probeDepth);

const { storage, copySource, copyDestination } = BUFFER_USAGE;
const { PROBE_LEVELS, PROBE_MIDDLE } = constants;

/**
 * Probes points of the last frame, drawn by any rasterizer. Reads back from the GPU: call it for clicks and labels, not
 * for every frame.
 * @returns An answer for each point, in the order of `points`.
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
    // The list of survivors, which `probe_surface` reads, temporarily overwrites the order.
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

/** Shader of `probe_surface`, for any kind of geometry. */
type SurfaceShader = ShaderDescription & Pick<typeof probeSurface, 'bindings'>;

/** Replaces the depths of splat centers in the answers by the depths of surfaces, block by block. */
function recordSurfaces(
  device: GPUDevice,
  pass: GPUComputePassEncoder,
  { table, scratch }: FrameBindings,
  { points, answers, count }: { points: GPUBuffer; answers: GPUBuffer; count: number },
): void {
  const { order, plan } = scratch;
  table.blocks.forEach((page, i) => {
    const plain = page.reading ? probeSurfaceQuantized : probeSurface;
    const kernel = kernelOf<SurfaceShader>(device, table.readingOf(i)?.probeSurface ?? plain);
    const bound = { view: table.view(i), gaussians: page.geometry, survivors: order[0], plan, points, answers };
    const group = kernel.bind({ ...table.modifiersOf(i), ...bound });
    kernel.dispatch(pass, group, count);
  });
}

function readAnswers(found: ArrayBuffer, points: number, splatOf: (stored: number) => ProbedSplat): ProbeAnswer[] {
  const { size, fields } = layouts.ProbeAnswer;
  const view = new DataView(found);
  return Array.from({ length: points }, (_, i) => {
    const at = i * size;
    const valueOf = ({ offset }: { readonly offset: number }): number => view.getFloat32(at + offset, true);
    const layers = new Float32Array(found, at + fields.depths.offset, PROBE_LEVELS);
    const stored = view.getUint32(at + fields.stored.offset + 4 * PROBE_MIDDLE, true);
    const transmittance = valueOf(fields.in_front);
    const thickness = valueOf(fields.thickness);
    const splat = stored === 0 ? null : splatOf(stored - 1);
    return { opacity: valueOf(fields.opacity), ...depthsOf(layers), layers, thickness, transmittance, splat };
  });
}

/** Largest float32 with two digits: WGSL compilers may assume that there are no infinities. */
const MAX_FLOAT32 = 3.4e38;
const finite = (value: number): number => Math.min(MAX_FLOAT32, Math.max(-MAX_FLOAT32, value));
