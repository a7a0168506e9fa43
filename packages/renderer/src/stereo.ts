import { inverse, multiply, type Camera, type SplatFilter } from '@gaussian-splat/core';
import { recordProjection, type Frame } from './frame.js';
import type { FrameSettings, Rgba, TargetView } from './frame-target.js';
import type { PageRequests } from './gaussian-scene.js';
import { BUFFER_USAGE } from './gpu/kernel.js';
import { GpuMemory } from './gpu/memory.js';
import { Rectangle, type RectangleBounds } from './rectangle.js';
import { scaled } from './view.js';
import type { Viewpoint } from './viewpoint.js';

/** One view of a headset. */
export interface StereoView {
  /** Camera of the view, whose image has the size of {@link bounds}. */
  readonly camera: Camera;
  readonly target: TargetView;
  /** Part of the target that the view covers. */
  readonly bounds: RectangleBounds;
}

/** Background and filter of a frame of {@link Stereo}. */
export interface StereoFrame {
  /** Background of the splats with premultiplied color. Default: transparent. */
  readonly background?: Rgba | undefined;
  /** Low-pass filter that overrides those of the scenes. */
  readonly filter?: SplatFilter | undefined;
}

/**
 * Tolerances of parallel eyes in one plane: the sine of their angle, and their distance along the axis as a fraction of
 * the near plane's distance.
 */
const [PARALLEL, SAME_DEPTH] = [1e-4, 1e-3];
/** Factor of the tangents of the shared view, because the projection of splats is perspective only approximately. */
const MARGIN = 1.05;

/**
 * Returns a camera whose image contains the images of all eyes. Undefined unless the eyes are parallel and in one
 * plane. The camera is behind the eyes, which adds the same length to all depths: the order by depth is that of each
 * eye.
 */
export function unionOf(eyes: readonly Camera[]): Camera | undefined {
  const [first, ...others] = eyes;
  const places = [[0, 0]];
  const toFirst = inverse(first.worldToCamera);
  for (const eye of others) {
    const m = multiply(eye.worldToCamera, toFirst);
    const turn = Math.max(...[0, 1, 2].flatMap((r) => [0, 1, 2].map((c) => Math.abs(m[4 * r + c] - Number(r === c)))));
    if (turn > PARALLEL || Math.abs(m[11]) > SAME_DEPTH * first.near) return undefined;
    places.push([-m[3], -m[7]]);
  }
  if (eyes.some(({ orthographic }) => orthographic)) return undefined;
  const middle = [0, 1].map((axis) => places.reduce((sum, place) => sum + place[axis], 0) / eyes.length);
  // Distance of the shared eye behind the others, so that the tangents of its image suffice.
  let back = 0;
  const edge = (tangentOf: (eye: Camera) => number, axis: number, sign: number): number => {
    const tangent = MARGIN * Math.max(...eyes.map(tangentOf));
    const aside = Math.max(...places.map((place) => sign * (place[axis] - middle[axis])));
    back = Math.max(back, aside / tangent);
    return tangent;
  };
  const left = edge(({ cx, fx }) => cx / fx, 0, -1);
  const right = edge(({ cx, fx, width }) => (width - cx) / fx, 0, 1);
  const top = edge(({ cy, fy }) => cy / fy, 1, -1);
  const bottom = edge(({ cy, fy, height }) => (height - cy) / fy, 1, 1);
  if (!(Math.min(left, right, top, bottom) > 0)) return undefined;
  const [fx, fy] = [Math.max(...eyes.map((eye) => eye.fx)), Math.max(...eyes.map((eye) => eye.fy))];
  const move = [1, 0, 0, -middle[0], 0, 1, 0, -middle[1], 0, 0, 1, back, 0, 0, 0, 1];
  return {
    worldToCamera: multiply(move, first.worldToCamera),
    ...{ fx, fy, cx: left * fx, cy: top * fy },
    width: Math.ceil((left + right) * fx),
    height: Math.ceil((top + bottom) * fy),
    near: back + Math.min(...eyes.map(({ near }) => near)),
    far: back + Math.max(...eyes.map(({ far }) => far)),
  };
}

/**
 * Draws the views of a headset into rectangles of textures. Parallel eyes share one cull and one sort, because the
 * order by depth depends only on the direction; each eye has its own projection. Other eyes, and orders other than
 * `center`, are drawn separately.
 *
 * ```ts
 * const stereo = new Stereo(device);
 * stereo.draw(viewpoint, [left, right], { background: [0, 0, 0, 1] });
 * ```
 */
export class Stereo {
  readonly #device: GPUDevice;
  readonly #memory: GpuMemory;
  /** Copies of the survivors by slot, and of the slots in their order; undefined before the first shared sort. */
  #kept: readonly [survivors: GPUBuffer, order: GPUBuffer] | undefined;

  constructor(device: GPUDevice) {
    this.#device = device;
    this.#memory = new GpuMemory(device);
  }

  /** Draws one frame of all views. @throws GaussianSplatError as `Viewpoint.draw` does. */
  draw(
    viewpoint: Viewpoint,
    views: readonly StereoView[],
    frame: StereoFrame = {},
    settings: FrameSettings = viewpoint.settings,
  ): void {
    const isByDepth = (settings.order ?? 'center') === 'center';
    const union = views.length > 1 && isByDepth ? unionOf(views.map(({ camera }) => camera)) : undefined;
    viewpoint.maxSizes = new Set(views.map(({ camera }) => `${camera.width} ${camera.height}`)).size;
    let shown: string | undefined;
    for (const { camera, target, bounds } of views) {
      const project = (encoder: GPUCommandEncoder, drawn: Frame): PageRequests[] => {
        // Pages that a streamed scene received after the cull may have moved its splats.
        const versions = viewpoint.world.placements.map(({ scene }) => scene.version).join();
        const isFirst = shown !== versions;
        const requests = isFirst ? this.#prepare(drawn, scaled(union!, drawn.camera.width / camera.width)) : [];
        shown = versions;
        this.#project(encoder, drawn);
        return requests;
      };
      const colors = new Rectangle(this.#device, bounds);
      viewpoint.draw(camera, { target, ...frame, colors, ...(union && { project }) }, settings);
    }
  }

  destroy(): void {
    this.#memory.destroy();
    this.#kept = undefined;
  }

  /**
   * Finds and sorts the splats that any eye sees, with the shared camera. Returns the page requests of streamed scenes.
   */
  #prepare(frame: Frame, union: Camera): PageRequests[] {
    const { scratch } = frame;
    const [survivors, order] = this.#keptFor(scratch.survivors.size);
    const encoder = this.#device.createCommandEncoder({ label: 'gs.stereo' });
    frame.look(union);
    const requests = recordProjection(encoder, { ...frame, camera: union, keepsSurvivors: true, timer: undefined });
    encoder.copyBufferToBuffer(scratch.survivors, 0, survivors, 0, survivors.size);
    encoder.copyBufferToBuffer(scratch.order[0], 0, order, 0, order.size);
    // A separate submission, because a uniform has one value for each submission.
    this.#device.queue.submit([encoder.finish()]);
    return requests;
  }

  /** Projects the shared splats, in their slots, to the image of one eye. */
  #project(encoder: GPUCommandEncoder, { bindings, scratch, camera, look }: Frame): void {
    const [survivors, order] = this.#kept!;
    look(camera);
    encoder.copyBufferToBuffer(survivors, 0, scratch.order[0], 0, survivors.size);
    const pass = encoder.beginComputePass({ label: 'gs.project' });
    for (const { reading, project, splatCount } of bindings.blocks)
      reading.project.record(pass, project, Math.min(scratch.capacity, splatCount));
    pass.end();
    encoder.copyBufferToBuffer(order, 0, scratch.order[0], 0, order.size);
  }

  #keptFor(bytes: number): readonly [GPUBuffer, GPUBuffer] {
    if (this.#kept?.[0].size === bytes) return this.#kept;
    this.#memory.destroy();
    const usage = BUFFER_USAGE.copySource | BUFFER_USAGE.copyDestination;
    const make = (name: string): GPUBuffer => this.#memory.buffer(`gs.stereo.${name}`, bytes, usage);
    return (this.#kept = [make('survivors'), make('order')]);
  }
}
