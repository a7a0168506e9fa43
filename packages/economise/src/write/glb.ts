import { shCoefficientCount, type GaussianCloud } from '@gaussian-splat/core';
import type { ReducedCloud } from '../reduce.js';

const EXTENSION = 'KHR_gaussian_splatting';
const [FLOAT, SHORT] = [5126, 5122];

/**
 * Signs of the coefficients of degrees 0 to 3 under the half turn about z that leads from a cloud's axes (right, down, forward) to
 * glTF's (left, up, forward).
 */
const HALF_TURN = [1, -1, 1, -1, 1, -1, 1, -1, 1, -1, 1, -1, 1, -1, 1, -1];

type Numbers = Float32Array<ArrayBuffer> | Int16Array<ArrayBuffer>;

/** Collects what a glTF file is made of. */
class Assembly {
  readonly chunks: Uint8Array[] = [];
  readonly bufferViews: object[] = [];
  readonly accessors: object[] = [];
  byteLength = 0;

  /** Adds numbers as an accessor; returns its index. */
  add(values: Numbers, width: number, bounds?: object): number {
    const bytes = new Uint8Array(values.buffer, values.byteOffset, values.byteLength);
    const padding = -bytes.length & 3;
    this.bufferViews.push({ buffer: 0, byteOffset: this.byteLength, byteLength: bytes.length });
    this.chunks.push(bytes, new Uint8Array(padding));
    this.byteLength += bytes.length + padding;
    const isFloat = values instanceof Float32Array;
    this.accessors.push({
      bufferView: this.bufferViews.length - 1,
      componentType: isFloat ? FLOAT : SHORT,
      ...(isFloat ? {} : { normalized: true }),
      count: values.length / width,
      type: width === 1 ? 'SCALAR' : `VEC${width}`,
      ...bounds,
    });
    return this.accessors.length - 1;
  }
}

/**
 * Writes GLB with `KHR_gaussian_splatting`: one primitive for each degree that splats keep, so that coefficients which went take no
 * bytes. Rotations are 16-bit normalised integers, which the extension allows; all else is float32.
 */
export function writeGlb({ cloud, degrees }: ReducedCloud): Uint8Array<ArrayBuffer> {
  const assembly = new Assembly();
  const primitives = [0, 1, 2, 3].flatMap((degree) => {
    const members: number[] = [];
    degrees.forEach((own, i) => {
      if (own === degree) members.push(i);
    });
    return members.length === 0 ? [] : [primitiveOf(cloud, members, degree, assembly)];
  });
  const json = {
    asset: { version: '2.0', generator: 'gaussian-splat economise' },
    extensionsUsed: [EXTENSION],
    scene: 0,
    scenes: [{ nodes: [0] }],
    nodes: [{ mesh: 0 }],
    meshes: [{ primitives }],
    accessors: assembly.accessors,
    bufferViews: assembly.bufferViews,
    buffers: [{ byteLength: assembly.byteLength }],
  };
  return containerOf(json, assembly);
}

function primitiveOf(cloud: GaussianCloud, members: readonly number[], degree: number, assembly: Assembly): object {
  const { opacities, scales, sh, shDegree } = cloud;
  /** Some numbers of the members' rows, each times a sign. */
  const columns = (values: Float32Array, stride: number, first: number, signs: readonly number[]): Numbers => {
    const width = signs.length;
    const out = new Float32Array(width * members.length);
    for (let n = 0; n < members.length; n++) {
      for (let k = 0; k < width; k++) out[width * n + k] = signs[k] * values[stride * members[n] + first + k];
    }
    return out;
  };
  const own = (name: string): string => `${EXTENSION}:${name}`;
  const places = placesOf(cloud, members);
  const attributes: Record<string, number> = {
    POSITION: assembly.add(places, 3, boundsOf(places)),
    [own('ROTATION')]: assembly.add(rotationsOf(cloud, members), 4),
    [own('SCALE')]: assembly.add(columns(scales, 3, 0, [1, 1, 1]), 3),
    [own('OPACITY')]: assembly.add(columns(opacities, 1, 0, [1]), 1),
  };
  const stride = 3 * shCoefficientCount(shDegree);
  for (let band = 0; band <= degree; band++) {
    for (let k = band * band; k < (band + 1) ** 2; k++) {
      const values = columns(sh, stride, 3 * k, [HALF_TURN[k], HALF_TURN[k], HALF_TURN[k]]);
      attributes[own(`SH_DEGREE_${band}_COEF_${k - band * band}`)] = assembly.add(values, 3);
    }
  }
  const splats = {
    kernel: 'ellipse',
    colorSpace: 'srgb_rec709_display',
    sortingMethod: 'cameraDistance',
    projection: 'perspective',
  };
  return { mode: 0, attributes, extensions: { [EXTENSION]: splats } };
}

/** Positions in the world and in glTF's axes. */
function placesOf({ positions, origin }: GaussianCloud, members: readonly number[]): Float32Array<ArrayBuffer> {
  const out = new Float32Array(3 * members.length);
  members.forEach((i, n) => {
    out[3 * n] = -(positions[3 * i] + origin[0]);
    out[3 * n + 1] = -(positions[3 * i + 1] + origin[1]);
    out[3 * n + 2] = positions[3 * i + 2] + origin[2];
  });
  return out;
}

/** The product of (0, 0, 0, 1) and (w, x, y, z), in glTF's order (x, y, z, w). */
function rotationsOf({ rotations }: GaussianCloud, members: readonly number[]): Int16Array<ArrayBuffer> {
  const out = new Int16Array(4 * members.length);
  members.forEach((i, n) => {
    out[4 * n] = Math.round(-32_767 * rotations[4 * i + 2]);
    out[4 * n + 1] = Math.round(32_767 * rotations[4 * i + 1]);
    out[4 * n + 2] = Math.round(32_767 * rotations[4 * i]);
    out[4 * n + 3] = Math.round(-32_767 * rotations[4 * i + 3]);
  });
  return out;
}

/** glTF asks for the bounds of positions. */
function boundsOf(positions: Float32Array): object {
  const [min, max] = [new Array<number>(3).fill(Infinity), new Array<number>(3).fill(-Infinity)];
  for (let at = 0; at < positions.length; at += 3) {
    for (let axis = 0; axis < 3; axis++) {
      min[axis] = Math.min(min[axis], positions[at + axis]);
      max[axis] = Math.max(max[axis], positions[at + axis]);
    }
  }
  return { min, max };
}

function containerOf(json: object, { chunks, byteLength }: Assembly): Uint8Array<ArrayBuffer> {
  const text = new TextEncoder().encode(JSON.stringify(json));
  const textLength = text.length + (-text.length & 3);
  const bytes = new Uint8Array(28 + textLength + byteLength);
  const view = new DataView(bytes.buffer);
  const words = (at: number, ...values: number[]): void =>
    values.forEach((value, k) => view.setUint32(at + 4 * k, value, true));
  // "glTF", version 2, length; then length and type "JSON" of the first chunk.
  words(0, 0x46546c67, 2, bytes.length, textLength, 0x4e4f534a);
  bytes.fill(0x20, 20, 20 + textLength);
  bytes.set(text, 20);
  // "BIN" and a zero.
  words(20 + textLength, byteLength, 0x004e4942);
  let at = 28 + textLength;
  for (const chunk of chunks) {
    bytes.set(chunk, at);
    at += chunk.length;
  }
  return bytes;
}
