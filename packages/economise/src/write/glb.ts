import { shCoefficientCount, type GaussianCloud } from '@gaussian-splat/core';
import type { ReducedCloud } from '../reduce.js';

const EXTENSION = 'KHR_gaussian_splatting';
const [FLOAT, SHORT] = [5126, 5122];

/**
 * Signs of the coefficients of degrees 0 to 3 under the half turn about z that leads from a cloud's axes (right, down, forward) to
 * glTF's (left, up, forward).
 */
const HALF_TURN = [1, -1, 1, -1, 1, -1, 1, -1, 1, -1, 1, -1, 1, -1, 1, -1];

/** The same turn of places. */
const PLACE_SIGNS = [-1, -1, 1];

/** What the extension says of every primitive. */
const SPLATS = {
  kernel: 'ellipse',
  colorSpace: 'srgb_rec709_display',
  sortingMethod: 'cameraDistance',
  projection: 'perspective',
};

/** Splats are visited in blocks of this many, so that their rows stay in the cache while column after column of them is written. */
const BLOCK = 256;

type Numbers = Float32Array<ArrayBuffer> | Int16Array<ArrayBuffer>;

/** What a primitive says of each of its splats. Of every attribute a splat takes whole words. */
interface Attribute {
  readonly name: string;
  readonly width: number;
  readonly isShort?: boolean;
  readonly bounds?: object;
  /** Writes the numbers of splats `first` to `end` of the primitive, from the beginning of `out` on. */
  readonly put: (out: Numbers, first: number, end: number) => void;
}

/** The splats that keep one degree. */
interface Primitive {
  readonly count: number;
  readonly attributes: readonly Attribute[];
}

/**
 * Writes GLB with `KHR_gaussian_splatting`: one primitive for each degree that splats keep, so that coefficients which went take no
 * bytes. Rotations are 16-bit normalised integers, which the extension allows; all else is float32.
 */
export function writeGlb({ cloud, degrees }: ReducedCloud): Uint8Array<ArrayBuffer> {
  const primitives = [0, 1, 2, 3].flatMap((degree) => {
    const members = membersOf(degrees, degree);
    return members.length === 0 ? [] : [primitiveOf(cloud, members, degree)];
  });
  const { json, byteLength } = describe(primitives);
  const { bytes, start } = containerOf(json, byteLength);
  let at = start;
  for (const { count, attributes } of primitives) {
    const arrays = attributes.map(({ width, isShort }) => {
      const array = isShort
        ? new Int16Array(bytes.buffer, at, width * count)
        : new Float32Array(bytes.buffer, at, width * count);
      at += array.byteLength;
      return array;
    });
    for (let first = 0; first < count; first += BLOCK) {
      const end = Math.min(count, first + BLOCK);
      attributes.forEach(({ width, put }, k) => put(arrays[k].subarray(width * first, width * end), first, end));
    }
  }
  return bytes;
}

/** Numbers of the splats that keep a degree. */
function membersOf(degrees: Uint8Array, degree: number): Uint32Array {
  const members = new Uint32Array(degrees.length);
  let count = 0;
  for (let i = 0; i < degrees.length; i++) if (degrees[i] === degree) members[count++] = i;
  return members.subarray(0, count);
}

/** The file but for its numbers, and how many bytes these take. */
function describe(primitives: readonly Primitive[]): { json: object; byteLength: number } {
  const bufferViews: object[] = [];
  const accessors: object[] = [];
  let byteLength = 0;
  const add = ({ width, isShort, bounds }: Attribute, count: number): number => {
    const length = (isShort ? 2 : 4) * width * count;
    bufferViews.push({ buffer: 0, byteOffset: byteLength, byteLength: length });
    byteLength += length;
    return (
      accessors.push({
        bufferView: bufferViews.length - 1,
        componentType: isShort ? SHORT : FLOAT,
        ...(isShort && { normalized: true }),
        count,
        type: width === 1 ? 'SCALAR' : `VEC${width}`,
        ...bounds,
      }) - 1
    );
  };
  const meshPrimitives = primitives.map(({ count, attributes }) => ({
    mode: 0,
    attributes: Object.fromEntries(attributes.map((attribute) => [attribute.name, add(attribute, count)])),
    extensions: { [EXTENSION]: SPLATS },
  }));
  const json = {
    asset: { version: '2.0', generator: 'gaussian-splat economise' },
    extensionsUsed: [EXTENSION],
    scene: 0,
    scenes: [{ nodes: [0] }],
    nodes: [{ mesh: 0 }],
    meshes: [{ primitives: meshPrimitives }],
    accessors,
    bufferViews,
    buffers: [{ byteLength }],
  };
  return { json, byteLength };
}

function primitiveOf(cloud: GaussianCloud, members: Uint32Array, degree: number): Primitive {
  const { opacities, scales, sh, shDegree } = cloud;
  /** Some numbers of the members' rows, each times a sign. */
  const columns = (name: string, values: Float32Array, stride: number, at: number, width: number, sign = 1) => ({
    name: `${EXTENSION}:${name}`,
    width,
    put: (out: Numbers, first: number, end: number): void => {
      for (let n = first; n < end; n++) {
        const to = width * (n - first);
        const from = stride * members[n] + at;
        for (let k = 0; k < width; k++) out[to + k] = sign * values[from + k];
      }
    },
  });
  const stride = 3 * shCoefficientCount(shDegree);
  const colours = [0, 1, 2, 3].slice(0, degree + 1).flatMap((band) =>
    Array.from({ length: 2 * band + 1 }, (_, k) => {
      const n = band * band + k;
      return columns(`SH_DEGREE_${band}_COEF_${k}`, sh, stride, 3 * n, 3, HALF_TURN[n]);
    }),
  );
  const attributes = [
    placesOf(cloud, members),
    rotationsOf(cloud, members),
    columns('SCALE', scales, 3, 0, 3),
    columns('OPACITY', opacities, 1, 0, 1),
    ...colours,
  ];
  return { count: members.length, attributes };
}

/** Positions in the world and in glTF's axes, with the bounds that glTF asks for. */
function placesOf({ positions, origin }: GaussianCloud, members: Uint32Array): Attribute {
  const places = new Float32Array(3 * members.length);
  const [min, max] = [new Array<number>(3).fill(Infinity), new Array<number>(3).fill(-Infinity)];
  for (let n = 0; n < members.length; n++) {
    for (let axis = 0; axis < 3; axis++) {
      const place = Math.fround(PLACE_SIGNS[axis] * (positions[3 * members[n] + axis] + origin[axis]));
      places[3 * n + axis] = place;
      if (place < min[axis]) min[axis] = place;
      if (place > max[axis]) max[axis] = place;
    }
  }
  const put = (out: Numbers, first: number, end: number): void => out.set(places.subarray(3 * first, 3 * end));
  return { name: 'POSITION', width: 3, bounds: { min, max }, put };
}

/** The product of (0, 0, 0, 1) and (w, x, y, z), in glTF's order (x, y, z, w). */
function rotationsOf({ rotations }: GaussianCloud, members: Uint32Array): Attribute {
  const put = (out: Numbers, first: number, end: number): void => {
    for (let n = first; n < end; n++) {
      const to = 4 * (n - first);
      const from = 4 * members[n];
      out[to] = Math.round(-32_767 * rotations[from + 2]);
      out[to + 1] = Math.round(32_767 * rotations[from + 1]);
      out[to + 2] = Math.round(32_767 * rotations[from]);
      out[to + 3] = Math.round(-32_767 * rotations[from + 3]);
    }
  };
  return { name: `${EXTENSION}:ROTATION`, width: 4, isShort: true, put };
}

/** A GLB whose binary chunk is still empty, and the byte where that begins. */
function containerOf(json: object, byteLength: number): { bytes: Uint8Array<ArrayBuffer>; start: number } {
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
  return { bytes, start: 28 + textLength };
}
