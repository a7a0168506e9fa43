/** Copies of a scene, as one cloud or straight to the GPU. */
import { GaussianBuffers, packGaussians } from '@gaussian-splat/renderer';

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
 * @returns {Promise<GaussianBuffers[]>} to be drawn together.
 */
export async function uploadTiled(device, cloud, copies, packOptions) {
  const packed = packGaussians(cloud, packOptions);
  const uploads = [];
  for (let first = 0; first < copies.length;) {
    let [end, count] = [first, 0];
    while (end < copies.length && (end === first || count + copies[end].length <= UPLOAD))
      count += copies[end++].length;
    const part = packCopies(cloud, packed, copies.slice(first, end), packOptions);
    uploads.push(await GaussianBuffers.upload(device, part));
    first = end;
  }
  return uploads;
}

/** Packed copies of a cloud that is packed already: all of its typed arrays are repeated, whatever they hold. */
export function packCopies(cloud, packed, copies, packOptions) {
  const count = copies.reduce((sum, { length }) => sum + length, 0);
  const arrays = Object.entries(packed).filter(([, value]) => ArrayBuffer.isView(value));
  const out = { ...packed, count };
  for (const [name, array] of arrays) out[name] = new array.constructor((array.length / packed.count) * count);
  const shiftInPlace = positionsArePlain(cloud, packed);
  let at = 0;
  for (const { offset, length } of copies) {
    const source = shiftInPlace ? packed : packGaussians(shiftedCloud(cloud, offset), packOptions);
    for (const [name, array] of arrays) {
      const stride = array.length / packed.count;
      out[name].set(source[name].subarray(0, stride * length), stride * at);
    }
    if (shiftInPlace) {
      const stride = packed.geometry.length / packed.count;
      shift(new Float32Array(out.geometry.buffer), stride * at, stride, length, offset);
    }
    at += length;
  }
  return out;
}

/** Whether a splat's geometry starts with its position in float32; if not, each copy is packed anew, which is slow. */
function positionsArePlain({ count, positions }, packed) {
  const floats = new Float32Array(packed.geometry.buffer, packed.geometry.byteOffset, packed.geometry.length);
  const stride = packed.geometry.length / packed.count;
  return (
    packed.count === count &&
    [0, count - 1].every((i) => [0, 1, 2].every((k) => floats[stride * i + k] === positions[3 * i + k]))
  );
}

function shiftedCloud(cloud, offset) {
  const positions = cloud.positions.slice();
  shift(positions, 0, 3, cloud.count, offset);
  return { ...cloud, positions };
}

/** Adds an offset to the three floats at the start of each of `length` records. */
function shift(floats, at, stride, length, [x, y, z]) {
  for (let i = at, end = at + stride * length; i < end; i += stride) {
    floats[i] += x;
    floats[i + 1] += y;
    floats[i + 2] += z;
  }
}
