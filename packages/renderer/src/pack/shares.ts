import { MAX_POSITION, type GaussianCloud, type ShDegree, type Vector3 } from '@gaussian-splat/core';
import { constants } from '../generated/shaders.js';
import { CHUNK_NUMBERS, reachOf } from './chunks.js';
import { mortonOrder } from './morton.js';
import { GEOMETRY_WORDS, packGeometry, type PackedGaussians, type PackOptions } from './pack.js';
import { recentred } from './recentre.js';
import { BAND_SIZES, choosePrecision, CODE_NOISE, packSh, SCALE_BYTES, shWords, type ShPrecision } from './sh.js';

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

/** How shares are put together. */
export interface JoinOptions extends PackOptions {
  /** Called once the shares have the precision that the scene needs: the file is of no more use. */
  readonly onSettled?: () => void;
  /** Frees arrays of shares that have been copied. */
  readonly release?: (...arrays: ArrayBufferView[]) => void;
}

/** Packs at most {@link SHARE_SPLATS} splats, all of which can be drawn. */
export function packShare(cloud: GaussianCloud, shPrecision: ShPrecision): PackedShare {
  const { count } = cloud;
  const order = mortonOrder(cloud.positions, identity(count), SHARE_SAMPLES);
  const reaches = new Float32Array(count);
  const opacities = new Float32Array(count);
  for (let k = 0; k < count; k++) {
    reaches[k] = reachOf(cloud, order[k]);
    opacities[k] = cloud.opacities[order[k]];
  }
  return {
    ...{ count, shPrecision, opacities, reaches },
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
  { sh: asked = 'auto', onSettled, release }: JoinOptions,
  facts: ShareFacts,
): JoinedShares | ShPrecision {
  const count = shares.reduce((sum, share) => sum + share.count, 0);
  const { positions, opacities, places } = columnsOf(shares, count);
  const cloud = recentred({ ...facts, count, positions, opacities } as GaussianCloud);
  const usable = usableOf(cloud.positions, count);
  const kept = mortonOrder(cloud.positions, usable);
  const shPrecision = asked === 'auto' ? precisionFor(shares, facts.shDegree, kept, places) : asked;
  if (shares.some((share) => share.shPrecision !== shPrecision)) return shPrecision;
  onSettled?.();
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
      release,
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

/** As the scales of their `int8` codes say; shares have `float16` only once that has been found too coarse. */
function precisionFor(
  shares: readonly PackedShare[],
  shDegree: ShDegree,
  kept: Uint32Array,
  places: Uint32Array,
): ShPrecision {
  if (shares.some(({ shPrecision }) => shPrecision !== 'int8')) return 'float16';
  const codes = shares.map(({ sh }) => new Uint8Array(sh.buffer));
  const stride = 4 * shWords(shDegree, 'int8');
  return choosePrecision((i) => {
    const at = stride * (places[i] & MASK);
    let noise = 0;
    for (let band = 0; band < shDegree; band++)
      noise += BAND_SIZES[band] * CODE_NOISE[codes[places[i] >>> SHIFT][at + SCALE_BYTES[band]]];
    return noise;
  }, kept);
}

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

/** The words of the splats in their order, and the bounds of each chunk of them. Its time is waiting for memory, and processors wait for reads only: shares are read from their first splat to their last. */
function gather(
  shares: readonly PackedShare[],
  kept: Uint32Array,
  places: Uint32Array,
  moved: Float32Array | undefined,
  shStride: number,
  release: JoinOptions['release'],
): Pick<PackedGaussians, 'geometry' | 'sh' | 'chunks'> {
  const geometry = new Uint32Array(GEOMETRY_WORDS * kept.length);
  const sh = new Uint32Array(shStride * kept.length);
  const reaches = new Float32Array(kept.length);
  const targets = new Uint32Array(shares.length << SHIFT).fill(LEFT_OUT);
  for (let k = 0; k < kept.length; k++) targets[places[kept[k]]] = k;
  shares.forEach((share, number) => {
    const own = targets.subarray(number << SHIFT, (number + 1) << SHIFT);
    spread(share.geometry, own, geometry, GEOMETRY_WORDS, share.count);
    spread(share.sh, own, sh, shStride, share.count);
    for (let i = 0; i < share.count; i++) if (own[i] !== LEFT_OUT) reaches[own[i]] = share.reaches[i];
    release?.(share.geometry, share.sh);
  });
  const floats = new Float32Array(geometry.buffer);
  if (moved)
    for (let k = 0; k < kept.length; k++)
      for (let axis = 0; axis < 3; axis++) floats[GEOMETRY_WORDS * k + axis] = moved[3 * kept[k] + axis];
  const chunks = new Float32Array(CHUNK_NUMBERS * Math.ceil(kept.length / CULL_GROUP));
  for (let k = 0; k < kept.length; k++)
    grow(
      chunks,
      CHUNK_NUMBERS * Math.floor(k / CULL_GROUP),
      floats,
      GEOMETRY_WORDS * k,
      reaches[k],
      k % CULL_GROUP === 0,
    );
  return { geometry, sh, chunks };
}

/** In place of the number of a splat that is not kept. */
const LEFT_OUT = 0xffffffff;

/** Copies rows of words, row i to row `targets[i]`. */
function spread(from: Uint32Array, targets: Uint32Array, to: Uint32Array, stride: number, count: number): void {
  for (let i = 0; i < count; i++) {
    if (targets[i] === LEFT_OUT) continue;
    const [start, at] = [stride * i, stride * targets[i]];
    for (let k = 0; k < stride; k++) to[at + k] = from[start + k];
  }
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
