/** Copies of a scene, as one cloud or straight to the GPU. */
import { GaussianBuffers, packGaussians } from '@gaussian-splat/renderer';
import { packWithDetail } from '@gaussian-splat/renderer/tools';

/** Splats in one upload: their harmonics stay well under the largest array that browsers allocate. */
const UPLOAD = 6_500_000;

/** A cloud without the splats from `length` on. */
export function firstSplats(cloud, length) {
  if (length === cloud.count) return cloud;
  const cut = (array) => array.subarray(0, (array.length / cloud.count) * length);
  const { positions, scales, rotations, opacities, sh } = cloud;
  return {
    ...cloud,
    count: length,
    positions: cut(positions),
    scales: cut(scales),
    rotations: cut(rotations),
    opacities: cut(opacities),
    sh: cut(sh),
  };
}

/** The copies as one cloud: for other renderers and for the oracle, where a few million splats are the most. */
export function tileCloud(cloud, copies) {
  const count = copies.reduce((sum, { length }) => sum + length, 0);
  const whole = { ...cloud, count };
  for (const name of ['positions', 'scales', 'rotations', 'opacities', 'sh']) {
    const stride = cloud[name].length / cloud.count;
    const all = new Float32Array(stride * count);
    let at = 0;
    for (const { offset, length } of copies) {
      all.set(cloud[name].subarray(0, stride * length), at);
      if (name === 'positions') shift(all, at, stride, length, offset);
      at += stride * length;
    }
    whole[name] = all;
  }
  return whole;
}

/**
 * Uploads the copies, a few million splats at a time, without ever holding them all in memory.
 * @param pack options of packGaussians, and `detail`: levels of detail. The same object is passed on, because its reads
 * are watched to find unread options.
 * @returns {Promise<GaussianBuffers[]>} to be drawn together.
 */
export async function uploadTiled(device, cloud, copies, pack = {}) {
  // Levels of detail are built over all copies together.
  if (pack.detail) return [await GaussianBuffers.upload(device, packWithDetail(tileCloud(cloud, copies), pack))];
  const packed = packGaussians(cloud, pack);
  if (copies.length === 1) return [await GaussianBuffers.upload(device, shifted(packed, copies[0].offset))];
  const uploads = [];
  for (let first = 0; first < copies.length;) {
    let [end, count] = [first, 0];
    while (end < copies.length && (end === first || count + copies[end].length <= UPLOAD))
      count += copies[end++].length;
    uploads.push(await GaussianBuffers.upload(device, packCopies(packed, copies.slice(first, end))));
    first = end;
  }
  return uploads;
}

/** Splats whose bounds the packed scene keeps together. */
const CHUNK = 256;
/** Numbers of a chunk: least x, y, z, reach, greatest x, y, z, nothing. */
const CHUNK_NUMBERS = 8;

/** Packed copies of a packed scene, each cut to whole chunks: at most 255 splats of a copy are missing. */
export function packCopies(packed, copies) {
  const lengths = copies.map(({ length }) => Math.floor(length / CHUNK) * CHUNK);
  const count = lengths.reduce((sum, length) => sum + length, 0);
  const strides = { geometry: packed.geometry.length / packed.count, sh: packed.sh.length / packed.count };
  const geometry = new Uint32Array(strides.geometry * count);
  const sh = new Uint32Array(strides.sh * count);
  const chunks = new Float32Array((CHUNK_NUMBERS * count) / CHUNK);
  let at = 0;
  copies.forEach(({ offset }, i) => {
    const length = lengths[i];
    geometry.set(packed.geometry.subarray(0, strides.geometry * length), strides.geometry * at);
    sh.set(packed.sh.subarray(0, strides.sh * length), strides.sh * at);
    const firstChunk = (CHUNK_NUMBERS * at) / CHUNK;
    chunks.set(packed.chunks.subarray(0, (CHUNK_NUMBERS * length) / CHUNK), firstChunk);
    const own = {
      geometry: geometry.subarray(strides.geometry * at, strides.geometry * (at + length)),
      chunks: chunks.subarray(firstChunk, firstChunk + (CHUNK_NUMBERS * length) / CHUNK),
    };
    shiftPacked(own, strides.geometry, offset);
    at += length;
  });
  return { ...packed, count, geometry, sh, chunks };
}

function shifted(packed, offset) {
  const moved = { ...packed, geometry: packed.geometry.slice(), chunks: packed.chunks.slice() };
  shiftPacked(moved, packed.geometry.length / packed.count, offset);
  return moved;
}

/** Moves packed splats, whose first values are their positions in float32, and the bounds of their chunks. */
function shiftPacked({ geometry, chunks }, stride, offset) {
  const floats = new Float32Array(geometry.buffer, geometry.byteOffset, geometry.length);
  shift(floats, 0, stride, geometry.length / stride, offset);
  shift(chunks, 0, CHUNK_NUMBERS / 2, (2 * chunks.length) / CHUNK_NUMBERS, offset);
}

/** Adds an offset to the three floats at the start of each of `length` records. */
function shift(floats, at, stride, length, [x, y, z]) {
  for (let i = at, end = at + stride * length; i < end; i += stride) {
    floats[i] += x;
    floats[i + 1] += y;
    floats[i + 2] += z;
  }
}
