import { GaussianSplatError, type GaussianCloud } from '@gaussian-splat/core';
import { concatenated } from '@gaussian-splat/core/fetch';
import {
  ANIMATED_ATTRIBUTES,
  ANIMATED_ATTRIBUTE_NAMES,
  readScene,
  type ClipPartContent,
  type Fades,
  type Lives,
  type AnimatedAttributeName,
} from '@gaussian-splat/formats';
import { packedOrder } from '@gaussian-splat/renderer/tools';
import { minCurve, motionFile, roundedPart, UNCHANGED, type Followed, type MotionSteps } from './write-motion.js';
import type { Deflate } from '../pages/page-planes.js';
import { splatsOf } from '../reduce.js';
import type { Encoding } from '../write/index.js';
import { takeFades } from './fades.js';
import { followedWithin } from './partial-curves.js';
import { changesOfTracks } from './track-changes.js';
import type { Tracks } from './tracks.js';

/** An encoded part of a group of frames, and its entry in the index of the clip. */
export interface WrittenClipPart {
  readonly splats: number;
  readonly planes: number;
  readonly sceneBytes: number;
  readonly motionBytes: number;
  readonly bytes: Uint8Array<ArrayBuffer>;
}

/**
 * Some tracks of a group: their splats as an encoded scene, and the curves of their motion, which can be quantized with
 * any steps.
 */
export class TrackedPart {
  readonly #scene: Uint8Array;
  readonly #cloud: GaussianCloud;
  readonly #lives: Lives;
  readonly #frames: number;
  readonly #followed: Readonly<Record<AnimatedAttributeName, Followed | undefined>>;

  private constructor(
    scene: Uint8Array,
    cloud: GaussianCloud,
    lives: Lives,
    frames: number,
    found: Readonly<Record<AnimatedAttributeName, Followed | undefined>>,
  ) {
    this.#scene = scene;
    this.#cloud = cloud;
    this.#lives = lives;
    this.#frames = frames;
    this.#followed = found;
  }

  /**
   * Encodes the scene of a part, and finds the curves of its motion.
   * @param whole Splats of all tracks.
   * @param chosen Indices of the tracks of this part.
   * @param encoding Encoding of the scene.
   * @param finest Minimum quantization steps of motion with which the part will be used.
   */
  static async of(
    tracks: Tracks,
    whole: GaussianCloud,
    chosen: Uint32Array,
    encoding: Encoding,
    finest: MotionSteps,
  ): Promise<TrackedPart> {
    const given = splatsOf(whole, chosen);
    const scene = new Uint8Array(
      await encoding.write({ cloud: given, degrees: new Uint8Array(given.count).fill(given.shDegree) }),
    );
    const cloud = await readScene(scene, { name: 'a group of frames' });
    if (cloud.count !== given.count) throw notWritten(given.count, cloud.count);
    const order = orderIn(cloud, given);
    const source = splatsOf(given, order);
    const placeOf = new Int32Array(tracks.count).fill(-1);
    order.forEach((i, place) => (placeOf[chosen[i]] = place));
    const livesOf = (own: Uint16Array): Uint16Array => Uint16Array.from(order, (i) => own[chosen[i]]);
    const lives = { first: livesOf(tracks.lives.first), end: livesOf(tracks.lives.end) };
    const frames = tracks.frames.length;
    // Changes are relative to the source in the order of the file, so that static splats have no motion. The error of
    // rounding the scene is part of the scene's fraction of the allowed error.
    let fades: Fades | undefined;
    const find = (name: AnimatedAttributeName): Followed | undefined => {
      const changes = changesOfTracks(tracks, { cloud: source, placeOf }, name);
      const span = (row: number): readonly [number, number] => [
        lives.first[row % cloud.count],
        lives.end[row % cloud.count],
      ];
      if (changes && name === 'opacity') fades = takeFades(changes, frames, source.opacities, lives);
      return changes && followedWithin(changes, frames, span, minCurve(finest[name]));
    };
    const found = Object.fromEntries(ANIMATED_ATTRIBUTE_NAMES.map((name) => [name, find(name)]));
    return new TrackedPart(
      scene,
      cloud,
      { ...lives, fades },
      frames,
      found as Record<AnimatedAttributeName, Followed | undefined>,
    );
  }

  /** Returns the content that a reader decodes if motion is quantized with the given steps. */
  contentAt(steps: MotionSteps): ClipPartContent {
    const parts = Object.fromEntries(
      ANIMATED_ATTRIBUTE_NAMES.map((name) => {
        const own = this.#followed[name];
        return [
          name,
          own ? roundedPart(strongest(own, minCurve(steps[name])), steps[name], this.#cloud.count) : UNCHANGED,
        ];
      }),
    ) as ClipPartContent['motion']['parts'];
    return {
      cloud: this.#cloud,
      motion: { splats: this.#cloud.count, frames: this.#frames, parts, lives: this.#lives },
    };
  }

  write(steps: MotionSteps, deflate: Deflate): WrittenClipPart {
    const { parts } = this.contentAt(steps).motion;
    const motion = motionFile({
      ...{ splats: this.#cloud.count, frames: this.#frames, lives: this.#lives, deflate },
      parts: ANIMATED_ATTRIBUTE_NAMES.map((name) => parts[name]),
    });
    return {
      splats: this.#cloud.count,
      planes: ANIMATED_ATTRIBUTE_NAMES.reduce((sum, name) => sum + ANIMATED_ATTRIBUTES[name] * parts[name].rank, 0),
      sceneBytes: this.#scene.length,
      motionBytes: motion.length,
      bytes: concatenated(Uint8Array, [this.#scene, motion]),
    };
  }
}

/** Returns the indices in `given` of the splats of a file. Formats keep the order, or sort splats as packing does. */
function orderIn(read: GaussianCloud, given: GaussianCloud): Uint32Array {
  const orders = [Uint32Array.from({ length: given.count }, (_, i) => i), packedOrder(given)];
  const apart = orders.map((order) => {
    let sum = 0;
    for (let k = 0; k < 3 * order.length; k++)
      sum += Math.abs(read.positions[k] - given.positions[3 * order[Math.floor(k / 3)] + (k % 3)]);
    return sum;
  });
  return orders[apart[0] <= apart[1] ? 0 : 1];
}

/** Returns the curves, with their weights, whose root mean square weight is above `min`. */
function strongest({ rows, frames, curves, shares }: Followed, min: number): Followed {
  const isStrong = shares.map((own) => {
    let sum = 0;
    for (let row = 0; row < own.length; row++) sum += own[row] * own[row];
    return sum / own.length > min * min;
  });
  return {
    ...{ rows, frames },
    curves: curves.filter((_, k) => isStrong[k]),
    shares: shares.filter((_, k) => isStrong[k]),
  };
}

const notWritten = (expected: number, found: number): GaussianSplatError =>
  new GaussianSplatError('argument/value', {
    where: 'frames of a sequence',
    expected: `${expected} splats that a scene file keeps`,
    found: `${found}`,
    remedy: 'report it, with the scene files',
  });
