/** Measures images of frames of a clip where their error may be largest. */
import { boundsOf, type GaussianCloud } from '@gaussian-splat/core';
import { clipFrame, LoadBudget, type ClipPartContent } from '@gaussian-splat/formats';
import type { Viewpoint } from '@gaussian-splat/renderer';
import { CloudBuffers } from '../gpu/cloud-buffers.js';
import { ImageErrors } from '../gpu/image-errors.js';
import { exactViewpoint } from '../gpu/show.js';
import { viewsAround } from '../views.js';

/** Number of views of each frame. They differ between frames. */
const VIEWS = 2;

/** Images of some frames of a group, against which clouds are compared. */
export class FrameJudges {
  readonly #device: GPUDevice;
  readonly #openFrame: (frame: number) => Promise<GaussianCloud>;
  readonly #viewpoint: Viewpoint;
  readonly #images = new Map<number, ImageErrors>();

  /** @param openFrame Reads a frame of the group by its index in the group, as it should be shown. */
  constructor(device: GPUDevice, openFrame: (frame: number) => Promise<GaussianCloud>) {
    this.#device = device;
    this.#openFrame = openFrame;
    this.#viewpoint = exactViewpoint(device);
  }

  /** Indices of the frames that have been measured, in the group. */
  get frames(): readonly number[] {
    return [...this.#images.keys()];
  }

  /**
   * Returns the mean squared errors of all views of a frame, peak 1.
   * @param cloud The frame as a clip shows it.
   */
  async compare(frame: number, cloud: GaussianCloud): Promise<readonly number[]> {
    const images = this.#images.get(frame) ?? (await this.#imagesOf(frame));
    const gaussians = await CloudBuffers.upload(this.#device, cloud);
    try {
      return await images.measure(gaussians);
    } finally {
      gaussians.destroy();
    }
  }

  /** Returns the errors of all views of some frames of a group's parts. */
  async errorsIn(frames: readonly number[], parts: readonly ClipPartContent[]): Promise<FrameError[]> {
    const errors: FrameError[] = [];
    for (const frame of frames)
      for (const error of await this.compare(frame, frameOf(parts, frame))) errors.push({ frame, error });
    return errors;
  }

  destroy(): void {
    for (const images of this.#images.values()) images.destroy();
    this.#viewpoint.destroy();
  }

  async #imagesOf(frame: number): Promise<ImageErrors> {
    const cloud = await this.#openFrame(frame);
    const views = viewsAround(boundsOf(cloud), VIEWS, { seed: 7 + frame });
    const gaussians = await CloudBuffers.upload(this.#device, cloud);
    try {
      const images = await ImageErrors.of(this.#device, this.#viewpoint, gaussians, views);
      this.#images.set(frame, images);
      return images;
    } finally {
      gaussians.destroy();
    }
  }
}

/** Mean squared error of a view of a frame, peak 1. */
export interface FrameError {
  readonly frame: number;
  readonly error: number;
}

export const frameOf = (parts: readonly ClipPartContent[], frame: number): GaussianCloud =>
  clipFrame(parts, frame, 'a group of frames', new LoadBudget(2 ** 40));
