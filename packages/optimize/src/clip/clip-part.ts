import { GaussianSplatError, type GaussianCloud } from '@gaussian-splat/core';
import { concatenated } from '@gaussian-splat/core/fetch';
import {
  ANIMATED_ATTRIBUTES,
  ANIMATED_ATTRIBUTE_NAMES,
  readScene,
  writeCodedMotion,
  type ClipPartContent,
  type Fades,
  type Lives,
  type AnimatedAttributeName,
  type WrittenMotion,
} from '@gaussian-splat/formats';
import { packedOrder } from '@gaussian-splat/renderer/tools';
import { splatsOf } from '../reduce.js';
import { scaledSteps } from '../steps.js';
import type { Encoding } from '../write/index.js';
import { FINER, minCurve, type Followed, type MotionSteps } from './curves.js';
import { takeFades } from './fades.js';
import { roundMotion, UNCHANGED } from './round-motion.js';
import { harmonicsTurn } from './turning-harmonics.js';
import { writePartScene } from './part-scene.js';
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

/** Content of a part whose motion can be written. */
export type TrackedContent = ClipPartContent & { readonly motion: WrittenMotion };

/** The splats of a part, in the order of its scene file, and what {@link TrackedPart} knows of their motion. */
interface FollowedSplats {
  /** In the order in which they are given to an encoding. */
  readonly given: GaussianCloud;
  readonly placeOf: Int32Array;
  readonly still: Omit<WrittenMotion, 'parts' | 'curveBits'>;
  readonly curves: Readonly<Record<AnimatedAttributeName, Followed | undefined>>;
}

interface EncodedScene {
  readonly bytes: Uint8Array;
  /** The splats as a reader decodes them. */
  readonly cloud: GaussianCloud;
}

/**
 * Some tracks of a group: their splats as an encoded scene, and the curves of their motion, which can be quantized with
 * any steps.
 */
export class TrackedPart {
  readonly #scene: EncodedScene;
  readonly #followed: FollowedSplats;
  /** [splats] effect on images of errors of positions, and of other attributes; 1 on average. */
  readonly #importance: Readonly<Record<'position' | 'other', Float32Array>>;

  private constructor(scene: EncodedScene, found: FollowedSplats) {
    this.#scene = scene;
    this.#followed = found;
    this.#importance = importanceOf(scene.cloud);
  }

  /** [tracks] index of each track's splat in this part, or -1. */
  get placeOf(): Int32Array {
    return this.#followed.placeOf;
  }

  /**
   * Encodes the scene of a part, and finds the curves of its motion.
   * @param whole Splats of all tracks.
   * @param chosen Indices of the tracks of this part.
   * @param encoding Encoding of the scene.
   * @param steps Quantization steps of motion; {@link contentAt} may be called with steps down to a sixteenth.
   */
  static async of(
    tracks: Tracks,
    whole: GaussianCloud,
    chosen: Uint32Array,
    encoding: Encoding,
    steps: MotionSteps,
  ): Promise<TrackedPart> {
    const given = splatsOf(whole, chosen);
    const scene = await encoded(given, encoding);
    const order = orderIn(scene.cloud, given);
    const source = splatsOf(given, order);
    const placeOf = new Int32Array(tracks.count).fill(-1);
    order.forEach((i, place) => (placeOf[chosen[i]] = place));
    const livesOf = (own: Uint16Array): Uint16Array => Uint16Array.from(order, (i) => own[chosen[i]]);
    const lives = { first: livesOf(tracks.lives.first), end: livesOf(tracks.lives.end) };
    const frames = tracks.frames.length;
    const finest = scaledSteps(steps, 1 / FINER);
    // Changes are relative to the source in the order of the file, so that static splats have no motion. The error of
    // rounding the scene is part of the scene's fraction of the allowed error.
    let fades: Fades | undefined;
    const find = (name: AnimatedAttributeName): Followed | undefined => {
      const changes = changesOfTracks(tracks, { cloud: source, placeOf }, name);
      const span = (row: number): readonly [number, number] => [
        lives.first[row % source.count],
        lives.end[row % source.count],
      ];
      if (changes && name === 'opacity') fades = takeFades(changes, frames, source.opacities, lives);
      return changes && followedWithin(changes, frames, span, minCurve(finest[name]));
    };
    const curves = Object.fromEntries(ANIMATED_ATTRIBUTE_NAMES.map((name) => [name, find(name)]));
    const turnsHarmonics = harmonicsTurn(tracks, { cloud: source, placeOf });
    const still = { splats: source.count, frames, lives: { ...lives, fades } satisfies Lives, turnsHarmonics };
    return new TrackedPart(scene, { given, placeOf, still, curves: curves as FollowedSplats['curves'] });
  }

  /** Returns this part with another encoding of the scene, of the same format. Curves do not depend on it. */
  async recoded(encoding: Encoding): Promise<TrackedPart> {
    return new TrackedPart(await encoded(this.#followed.given, encoding), this.#followed);
  }

  /** Returns the content that a reader decodes if motion is quantized with the given steps. */
  contentAt(steps: MotionSteps): TrackedContent {
    const rounded = ANIMATED_ATTRIBUTE_NAMES.map((name) => {
      const own = this.#followed.curves[name];
      const importance = this.#importance[name === 'position' ? name : 'other'];
      return own ? roundMotion(own, steps[name], importance) : UNCHANGED;
    });
    const parts = Object.fromEntries(ANIMATED_ATTRIBUTE_NAMES.map((name, k) => [name, rounded[k].part]));
    const curveBits = rounded.map((own) => own.curveBits);
    const motion = { ...this.#followed.still, parts: parts as WrittenMotion['parts'], curveBits };
    return { cloud: this.#scene.cloud, motion };
  }

  /** Writes the part. @param motion That of {@link contentAt}. */
  write(motion: WrittenMotion): WrittenClipPart {
    const { bytes: scene, cloud } = this.#scene;
    const bytes = writeCodedMotion(motion, cloud);
    return {
      splats: cloud.count,
      planes: ANIMATED_ATTRIBUTE_NAMES.reduce(
        (sum, name) => sum + ANIMATED_ATTRIBUTES[name] * motion.parts[name].rank,
        0,
      ),
      sceneBytes: scene.length,
      motionBytes: bytes.length,
      bytes: concatenated(Uint8Array, [scene, bytes]),
    };
  }
}

async function encoded(cloud: GaussianCloud, encoding: Encoding): Promise<EncodedScene> {
  const bytes = await writePartScene(cloud, encoding);
  const read = await readScene(bytes, { name: 'a group of frames' });
  if (read.count !== cloud.count) throw notWritten(cloud.count, read.count);
  return { bytes, cloud: read };
}

/**
 * Returns the effect of errors on images. The sum of the squared error of pixels grows with the squared opacity and, for
 * all attributes except position, with the area of the splat.
 */
function importanceOf({ count, opacities, scales }: GaussianCloud): Record<'position' | 'other', Float32Array> {
  const position = new Float32Array(count);
  const other = new Float32Array(count);
  for (let i = 0; i < count; i++) {
    const [a, b, c] = scales.subarray(3 * i, 3 * i + 3);
    position[i] = opacities[i] ** 2;
    other[i] = position[i] * Math.max(a * b, b * c, c * a);
  }
  for (const own of [position, other]) {
    const mean = own.reduce((sum, value) => sum + value, 0) / count;
    for (let i = 0; i < count; i++) own[i] = mean > 0 ? own[i] / mean : 1;
  }
  return { position, other };
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

const notWritten = (expected: number, found: number): GaussianSplatError =>
  new GaussianSplatError('argument/value', {
    where: 'frames of a sequence',
    expected: `${expected} splats that a scene file keeps`,
    found: `${found}`,
    remedy: 'report it, with the scene files',
  });
