/** Measures images of frames of a clip where their error may be largest. */
import { boundsOf, type Camera, type GaussianCloud } from '@gaussian-splat/core';
import { clipFrame, LoadBudget, type ClipPartContent } from '@gaussian-splat/formats';
import { CloudBuffers } from '../gpu/cloud-buffers.js';
import { ImageErrors } from '../gpu/image-errors.js';
import { exactViewpoint } from '../gpu/show.js';
import { mean } from '../measure.js';
import { viewsAround } from '../views.js';

/** Number of views of each frame, which differ between frames, and of those during the search for steps. */
const [VIEWS, SEARCHED_VIEWS] = [16, 3];

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
    const images = this.#images.get(frame) ?? (await this.#imagesOf(frame, SEARCHED_VIEWS));
    this.#images.set(frame, images);
    return images.compare(cloud);
  }

  /** Keeps images of some frames in all views, in which {@link errorsIn} measures them from now on. */
  async remember(frames: readonly number[]): Promise<void> {
    for (const frame of frames) {
      this.#images.get(frame)?.destroy();
      this.#images.delete(frame);
      this.#images.set(frame, await this.#imagesOf(frame));
    }
  }

  /** Returns the errors of some frames of a group's parts, in few views, and keeps the images of these frames. */
  async errorsIn(frames: readonly number[], parts: readonly ClipPartContent[]): Promise<FrameError[]> {
    const errors: FrameError[] = [];
    for (const frame of frames) errors.push(errorOf(frame, await this.compare(frame, frameOf(parts, frame))));
    return errors;
  }

  /** Returns the errors of the first `count` frames, in all views. */
  async errorsInAll(count: number, parts: readonly ClipPartContent[]): Promise<FrameError[]> {
    const errors: FrameError[] = [];
    for (let frame = 0; frame < count; frame++) {
      const images = await this.#imagesOf(frame);
      const found = await images.compare(frameOf(parts, frame)).finally(() => images.destroy());
      errors.push(errorOf(frame, found));
    }
    return errors;
  }

  destroy(): void {
    for (const images of this.#images.values()) images.destroy();
  }

  async #imagesOf(frame: number, views = VIEWS): Promise<FrameImages> {
    const cloud = await this.#openFrame(frame);
    return this.#draw(cloud, viewsAround(boundsOf(cloud), VIEWS, { seed: 7 + frame }).slice(0, views));
  }
}

/** Mean squared error of a frame, peak 1. */
export interface FrameError {
  readonly frame: number;
  /** Mean over its views. */
  readonly error: number;
  /** Largest error of a view. */
  readonly worst: number;
}

const errorOf = (frame: number, errors: readonly number[]): FrameError => ({
  frame,
  error: errors.length > 0 ? mean(errors) : 0,
  worst: Math.max(0, ...errors),
});

export const frameOf = (parts: readonly ClipPartContent[], frame: number): GaussianCloud =>
  clipFrame(parts, frame, 'a group of frames', new LoadBudget(2 ** 40));
