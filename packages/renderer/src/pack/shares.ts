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
/** Where neighbours lie in a share need not be known exactly. */
const SHARE_SAMPLES = 256;

/**
 * Some splats of a scene, packed: all but what takes the whole scene to know. Neighbours in space are neighbours here, too, so that the whole is put together with
 * few jumps through memory. Its buffers are transferable.
 */
export interface PackedShare {
  readonly count: number;
  /** Where each of them stood in the order that they came in. */
  readonly rows: Uint16Array<ArrayBuffer>;
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
  readonly filterVariance?: number | undefined;
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
  const order = mortonOrder(cloud.positions, identity(count), SHARE_SAMPLES);
  const noiseOf = noiseIn(cloud);
  const noises = new Float64Array(count);
  const reaches = new Float32Array(count);
  const opacities = new Float32Array(count);
  for (let k = 0; k < count; k++) {
    noises[k] = noiseOf(order[k]);
    reaches[k] = reachOf(cloud, order[k]);
    opacities[k] = cloud.opacities[order[k]];
  }
  return {
    ...{ count, shPrecision, opacities, noises, reaches },
    rows: Uint16Array.from(order),
    geometry: packGeometry(cloud, order) as Uint32Array<ArrayBuffer>,
    sh: packSh(cloud, order, shPrecision) as Uint32Array<ArrayBuffer>,
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
      filterVariance: facts.filterVariance,
      origin: cloud.origin,
    },
    droppedCount: facts.droppedCount + count - kept.length,
    ...gather(
      shares,
      kept,
      places,
      cloud.positions === positions ? undefined : cloud.positions,
      shWords(facts.shDegree, shPrecision),
    ),
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
  let first = 0;
  shares.forEach((share, number) => {
    const floats = new Float32Array(share.geometry.buffer);
    for (let i = 0; i < share.count; i++) {
      const splat = first + share.rows[i];
      positions[3 * splat] = floats[GEOMETRY_WORDS * i];
      positions[3 * splat + 1] = floats[GEOMETRY_WORDS * i + 1];
      positions[3 * splat + 2] = floats[GEOMETRY_WORDS * i + 2];
      opacities[splat] = share.opacities[i];
      places[splat] = (number << SHIFT) | i;
    }
    first += share.count;
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

/** The words of the splats in their order, and the bounds of each chunk of them. Its time is waiting for memory: a splat is read once, where it lies. */
function gather(
  shares: readonly PackedShare[],
  kept: Uint32Array,
  places: Uint32Array,
  moved: Float32Array | undefined,
  shStride: number,
): Pick<PackedGaussians, 'geometry' | 'sh' | 'chunks'> {
  const geometry = new Uint32Array(GEOMETRY_WORDS * kept.length);
  const floats = new Float32Array(geometry.buffer);
  const sh = new Uint32Array(shStride * kept.length);
  const chunks = new Float32Array(CHUNK_NUMBERS * Math.ceil(kept.length / CULL_GROUP));
  const geometries = shares.map((share) => share.geometry);
  const harmonics = shares.map((share) => share.sh);
  const reaches = shares.map((share) => share.reaches);
  for (let k = 0; k < kept.length; k++) {
    const place = places[kept[k]];
    const share = place >>> SHIFT;
    const i = place & MASK;
    copy(geometries[share], GEOMETRY_WORDS * i, geometry, GEOMETRY_WORDS * k, GEOMETRY_WORDS);
    copy(harmonics[share], shStride * i, sh, shStride * k, shStride);
    if (moved) for (let axis = 0; axis < 3; axis++) floats[GEOMETRY_WORDS * k + axis] = moved[3 * kept[k] + axis];
    grow(
      chunks,
      CHUNK_NUMBERS * Math.floor(k / CULL_GROUP),
      floats,
      GEOMETRY_WORDS * k,
      reaches[share][i],
      k % CULL_GROUP === 0,
    );
  }
  return { geometry, sh, chunks };
}

/** Takes another splat into a chunk: see `boundChunks`. */
function grow(
  chunks: Float32Array,
  at: number,
  floats: Float32Array,
  from: number,
  reach: number,
  isFirst: boolean,
): void {
  for (let axis = 0; axis < 3; axis++) {
    const x = floats[from + axis];
    if (isFirst || x < chunks[at + axis]) chunks[at + axis] = x;
    if (isFirst || x > chunks[at + 4 + axis]) chunks[at + 4 + axis] = x;
  }
  if (reach > chunks[at + 3]) chunks[at + 3] = reach;
}

function copy(from: Uint32Array, start: number, to: Uint32Array, at: number, count: number): void {
  for (let k = 0; k < count; k++) to[at + k] = from[start + k];
}
