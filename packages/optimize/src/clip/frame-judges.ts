/** Measures images of frames of a clip where their error may be largest. */
import { boundsOf, type Camera, type GaussianCloud } from '@gaussian-splat/core';
import { clipFrame, LoadBudget, type ClipPartContent } from '@gaussian-splat/formats';
import { CloudBuffers } from '../gpu/cloud-buffers.js';
import { ImageErrors } from '../gpu/image-errors.js';
import { exactViewpoint } from '../gpu/show.js';
import { viewsAround } from '../views.js';

/** Number of views of each frame. They differ between frames. */
const VIEWS = 3;

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

  /** Returns the errors of all views of some frames of a group's parts, and keeps the images of these frames. */
  async errorsIn(frames: readonly number[], parts: readonly ClipPartContent[]): Promise<FrameError[]> {
    const errors: FrameError[] = [];
    for (const frame of frames)
      for (const error of await this.compare(frame, frameOf(parts, frame))) errors.push({ frame, error });
    return errors;
  }

  /** Returns the errors of all views of the first `count` frames. Images that were not kept before are not kept. */
  async errorsInAll(count: number, parts: readonly ClipPartContent[]): Promise<FrameError[]> {
    const errors: FrameError[] = [];
    for (let frame = 0; frame < count; frame++) {
      const kept = this.#images.get(frame);
      const images = kept ?? (await this.#imagesOf(frame));
      for (const error of await images.compare(frameOf(parts, frame))) errors.push({ frame, error });
      if (!kept) images.destroy();
    }
    return errors;
  }

  destroy(): void {
    for (const images of this.#images.values()) images.destroy();
  }

  async #imagesOf(frame: number): Promise<FrameImages> {
    const cloud = await this.#openFrame(frame);
    return this.#draw(cloud, viewsAround(boundsOf(cloud), VIEWS, { seed: 7 + frame }));
  }
}

/** Mean squared error of a view of a frame, peak 1. */
export interface FrameError {
  readonly frame: number;
  readonly error: number;
}

export const frameOf = (parts: readonly ClipPartContent[], frame: number): GaussianCloud =>
  clipFrame(parts, frame, 'a group of frames', new LoadBudget(2 ** 40));
