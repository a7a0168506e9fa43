/** Measures images of frames of a clip where their error may be largest. */
import { boundsOf, type Camera, type GaussianCloud } from '@gaussian-splat/core';
import { clipFrame, LoadBudget, type ClipPartContent } from '@gaussian-splat/formats';
import { CloudBuffers } from '../gpu/cloud-buffers.js';
import { ImageErrors } from '../gpu/image-errors.js';
import { exactViewpoint } from '../gpu/show.js';
import { viewsAround, type ViewOptions } from '../views.js';

/** Number of views of each frame that are measured in full size. They differ between frames. */
const VIEWS = 3;
/**
 * Number and size of the views that find the worst ones of a result. Quantized splats may exchange their order in depth,
 * which few views show.
 */
const SCOUTS = 48;
const SCOUT_SIZE = { width: 160, height: 90 };
/** Views during the search for steps. */
const FIRST_VIEWS = [0, 1, 2];

/** Images of a frame, with which those of other clouds are compared. */
export interface FrameImages {
  /** Returns the mean squared error of each view, peak 1. */
  compare(cloud: GaussianCloud): Promise<readonly number[]>;
  destroy(): void;
}

/** Draws images of a frame in some views. */
export type DrawFrame = (frame: GaussianCloud, views: readonly Camera[]) => Promise<FrameImages>;

/** Returns a {@link DrawFrame} on a GPU. Of each frame, only its images remain in memory. */
export function drawOn(device: GPUDevice): DrawFrame {
  const uploaded = async <T>(cloud: GaussianCloud, use: (gaussians: CloudBuffers) => Promise<T>): Promise<T> => {
    const gaussians = await CloudBuffers.upload(device, cloud);
    return use(gaussians).finally(() => gaussians.destroy());
  };
  return async (frame, views) => {
    const viewpoint = exactViewpoint(device);
    const images = await uploaded(frame, (gaussians) => ImageErrors.of(device, viewpoint, gaussians, views));
    return {
      compare: (cloud) => uploaded(cloud, (gaussians) => images.measure(gaussians)),
      destroy: () => {
        images.destroy();
        viewpoint.destroy();
      },
    };
  };
}

/** Images of some frames of a group, with which clouds are compared. */
export class FrameJudges {
  readonly #draw: DrawFrame;
  readonly #openFrame: (frame: number) => Promise<GaussianCloud>;
  readonly #images = new Map<number, FrameImages>();

  /** @param openFrame Reads a frame of the group by its index in the group, as it should be shown. */
  constructor(draw: DrawFrame, openFrame: (frame: number) => Promise<GaussianCloud>) {
    this.#draw = draw;
    this.#openFrame = openFrame;
  }

  /** Indices of the frames that have been measured, in the group. */
  get frames(): readonly number[] {
    return [...this.#images.keys()];
  }

  /**
   * Returns the mean squared errors of all views of a frame, peak 1, and keeps its images.
   * @param cloud The frame as a clip shows it.
   */
  async compare(frame: number, cloud: GaussianCloud): Promise<readonly number[]> {
    const images = this.#images.get(frame) ?? (await this.#imagesOf(frame));
    this.#images.set(frame, images);
    return images.compare(cloud);
  }

  /** Keeps images of the views of some errors, so that {@link errorsIn} measures these views, too. */
  async remember(errors: readonly FrameError[]): Promise<void> {
    for (const frame of new Set(errors.map((own) => own.frame))) {
      this.#images.get(frame)?.destroy();
      this.#images.delete(frame);
      const views = errors.filter((own) => own.frame === frame).flatMap(({ view }) => view ?? []);
      this.#images.set(frame, await this.#imagesOf(frame, [...new Set([...FIRST_VIEWS, ...views])]));
    }
  }

  /** Returns the errors of some frames of a group's parts, and keeps the images of these frames. */
  async errorsIn(frames: readonly number[], parts: readonly ClipPartContent[]): Promise<FrameError[]> {
    const errors: FrameError[] = [];
    for (const frame of frames)
      for (const error of await this.compare(frame, frameOf(parts, frame))) errors.push({ frame, error });
    return errors;
  }

  /** Returns the errors of the first `count` frames in {@link SCOUTS} views. Of each frame, the worst are in full size. */
  async errorsInAll(count: number, parts: readonly ClipPartContent[]): Promise<FrameError[]> {
    const errors: FrameError[] = [];
    for (let frame = 0; frame < count; frame++) {
      const [source, coded] = [await this.#openFrame(frame), frameOf(parts, frame)];
      const measure = async (views: readonly Camera[]): Promise<readonly number[]> => {
        const images = await this.#draw(source, views);
        return images.compare(coded).finally(() => images.destroy());
      };
      const found = [...(await measure(viewsOf(source, frame, SCOUT_SIZE)))];
      const worst = [...found.keys()].sort((a, b) => found[b] - found[a]).slice(0, VIEWS);
      const views = viewsOf(source, frame);
      for (const [k, error] of (await measure(worst.map((view) => views[view]))).entries()) found[worst[k]] = error;
      for (const [view, error] of found.entries()) errors.push({ frame, view, error });
    }
    return errors;
  }

  destroy(): void {
    for (const images of this.#images.values()) images.destroy();
  }

  async #imagesOf(frame: number, views: readonly number[] = FIRST_VIEWS): Promise<FrameImages> {
    const cloud = await this.#openFrame(frame);
    const all = viewsOf(cloud, frame);
    return this.#draw(
      cloud,
      views.map((view) => all[view]),
    );
  }
}

const viewsOf = (cloud: GaussianCloud, frame: number, size?: ViewOptions): Camera[] =>
  viewsAround(boundsOf(cloud), SCOUTS, { seed: 7 + frame, ...size });

/** Mean squared error of a view of a frame, peak 1. */
export interface FrameError {
  readonly frame: number;
  /** Index among all views of the frame; undefined during the search. */
  readonly view?: number;
  readonly error: number;
}

export const frameOf = (parts: readonly ClipPartContent[], frame: number): GaussianCloud =>
  clipFrame(parts, frame, 'a group of frames', new LoadBudget(2 ** 40));
