import { MAX_POSITION, type GaussianCloud, type ShDegree, type Vector3 } from '@gaussian-splat/core';
import { constants } from '../generated/shaders.js';
import { CHUNK_NUMBERS, reachOf } from './chunks.js';
import { mortonOrder } from './morton.js';
import { GEOMETRY_WORDS, packGeometry, type PackedGaussians, type PackOptions } from './pack.js';
import { recentred } from './recentre.js';
import { choosePrecision, noiseIn, packSh, shWords, type ShPrecision } from './sh.js';

const { CULL_GROUP } = constants;

/** Splats of a share at most, a power of two. */
export const SHARE_SPLATS = 1 << 14;

/** Some splats of a scene, packed in the order that they came in: all but what takes the whole scene to know. Its buffers are transferable. */
export interface PackedShare {
  readonly count: number;
  readonly shPrecision: ShPrecision;
  readonly geometry: Uint32Array<ArrayBuffer>;
  readonly sh: Uint32Array<ArrayBuffer>;
  readonly opacities: Float32Array<ArrayBuffer>;
  /** How far each splat reaches from its centre: see `boundChunks`. */
  readonly reaches: Float32Array<ArrayBuffer>;
  /** What `int8` would do to the colour of each: see `choosePrecision`. */
  readonly noises: Float64Array<ArrayBuffer>;
}

/** What the shares of a scene have in common. */
export interface ShareFacts {
  readonly shDegree: ShDegree;
  readonly antialiased: boolean;
  readonly origin: Vector3;
  readonly droppedCount: number;
}

/** Scenes that several threads have packed, with what is needed to know their bounds. */
export interface JoinedShares {
  readonly packed: PackedGaussians;
  /** As they came. */
  readonly positions: Float32Array;
  readonly opacities: Float32Array;
}

/** Packs at most {@link SHARE_SPLATS} splats, all of which can be drawn. */
export function packShare(cloud: GaussianCloud, shPrecision: ShPrecision): PackedShare {
  const { count } = cloud;
  const all = identity(count);
  const noiseOf = noiseIn(cloud);
  const noises = new Float64Array(count);
  const reaches = new Float32Array(count);
  for (let i = 0; i < count; i++) {
    noises[i] = noiseOf(i);
    reaches[i] = reachOf(cloud, i);
  }
  return {
    ...{ count, shPrecision, noises, reaches },
    geometry: packGeometry(cloud, all) as Uint32Array<ArrayBuffer>,
    sh: packSh(cloud, all, shPrecision) as Uint32Array<ArrayBuffer>,
    opacities: cloud.opacities.slice(),
  };
}

/**
 * Puts shares together: to the byte what `packGaussians` makes of the whole scene.
 * @param shares in the order of the scene
 * @returns the precision that the scene needs, where shares have another: they must be packed again
 */
export function joinShares(
  shares: readonly PackedShare[],
  { sh: asked = 'auto' }: PackOptions,
  facts: ShareFacts,
): JoinedShares | ShPrecision {
  const count = shares.reduce((sum, share) => sum + share.count, 0);
  const { positions, opacities, places } = columnsOf(shares, count);
  const cloud = recentred({ ...facts, count, positions, opacities } as GaussianCloud);
  const usable = usableOf(cloud.positions, count);
  const kept = mortonOrder(cloud.positions, usable);
  const noiseOf = (i: number): number => shares[places[i] >>> SHIFT].noises[places[i] & MASK];
  const shPrecision = asked === 'auto' ? choosePrecision(noiseOf, kept) : asked;
  if (shares.some((share) => share.shPrecision !== shPrecision)) return shPrecision;
  const packed = {
    ...{
      count: kept.length,
      shDegree: facts.shDegree,
      shPrecision,
      antialiased: facts.antialiased,
      origin: cloud.origin,
    },
    droppedCount: facts.droppedCount + count - kept.length,
    ...gather(shares, kept, places, cloud.positions, shWords(facts.shDegree, shPrecision)),
  };
  return { packed, positions, opacities };
}

const SHIFT = Math.log2(SHARE_SPLATS);
const MASK = SHARE_SPLATS - 1;

const identity = (count: number): Uint32Array => {
  const all = new Uint32Array(count);
  for (let i = 0; i < count; i++) all[i] = i;
  return all;
};

/** Of all shares, and where each splat lies: its share, and its number there. */
function columnsOf(
  shares: readonly PackedShare[],
  count: number,
): { positions: Float32Array; opacities: Float32Array; places: Uint32Array } {
  const positions = new Float32Array(3 * count);
  const opacities = new Float32Array(count);
  const places = new Uint32Array(count);
  let at = 0;
  shares.forEach((share, number) => {
    const floats = new Float32Array(share.geometry.buffer);
    opacities.set(share.opacities, at);
    for (let i = 0; i < share.count; i++, at++) {
      positions[3 * at] = floats[GEOMETRY_WORDS * i];
      positions[3 * at + 1] = floats[GEOMETRY_WORDS * i + 1];
      positions[3 * at + 2] = floats[GEOMETRY_WORDS * i + 2];
      places[at] = (number << SHIFT) | i;
    }
  });
  return { positions, opacities, places };
}

/** Moved to another origin, a splat may be too far away. */
function usableOf(positions: Float32Array, count: number): Uint32Array {
  const usable = new Uint32Array(count);
  let kept = 0;
  for (let i = 0; i < count; i++) {
    const at = 3 * i;
    const farthest = Math.max(Math.abs(positions[at]), Math.abs(positions[at + 1]), Math.abs(positions[at + 2]));
    if (farthest <= MAX_POSITION) usable[kept++] = i;
  }
  return usable.subarray(0, kept);
}

/** The words of the splats in their order, and the bounds of each chunk of them. */
function gather(
  shares: readonly PackedShare[],
  kept: Uint32Array,
  places: Uint32Array,
  positions: Float32Array,
  shStride: number,
): Pick<PackedGaussians, 'geometry' | 'sh' | 'chunks'> {
  const geometry = new Uint32Array(GEOMETRY_WORDS * kept.length);
  const floats = new Float32Array(geometry.buffer);
  const sh = new Uint32Array(shStride * kept.length);
  const chunks = new Float32Array(CHUNK_NUMBERS * Math.ceil(kept.length / CULL_GROUP));
  const low = new Float64Array(3);
  const high = new Float64Array(3);
  for (let first = 0; first < kept.length; first += CULL_GROUP) {
    low.fill(Infinity);
    high.fill(-Infinity);
    let reach = 0;
    for (let k = first; k < Math.min(first + CULL_GROUP, kept.length); k++) {
      const splat = kept[k];
      const share = shares[places[splat] >>> SHIFT];
      const i = places[splat] & MASK;
      for (let axis = 0; axis < 3; axis++) {
        const x = positions[3 * splat + axis];
        floats[GEOMETRY_WORDS * k + axis] = x;
        if (x < low[axis]) low[axis] = x;
        if (x > high[axis]) high[axis] = x;
      }
      copy(share.geometry, GEOMETRY_WORDS * i + 3, geometry, GEOMETRY_WORDS * k + 3, GEOMETRY_WORDS - 3);
      copy(share.sh, shStride * i, sh, shStride * k, shStride);
      if (share.reaches[i] > reach) reach = share.reaches[i];
    }
    chunks.set([...low, reach, ...high, 0], (CHUNK_NUMBERS * first) / CULL_GROUP);
  }
  return { geometry, sh, chunks };
}

function copy(from: Uint32Array, start: number, to: Uint32Array, at: number, count: number): void {
  for (let k = 0; k < count; k++) to[at + k] = from[start + k];
}
