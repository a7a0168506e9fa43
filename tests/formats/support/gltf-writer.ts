/** Writes glTF with KHR_gaussian_splatting; shares no code with the reader. */
import type { GaussianCloud } from '@gaussian-splat/core';
import { MeshoptEncoder } from 'meshoptimizer/encoder';

export interface GltfPrimitive {
  readonly cloud: GaussianCloud;
  /** Payload of SPZ compression instead of attributes. */
  readonly spz?: Uint8Array;
}

export interface GltfNode {
  /** Index of the primitives' list. */
  readonly mesh?: number;
  readonly children?: readonly number[];
  readonly [transform: string]: unknown;
}

type Json = Record<string, unknown>;

const EXTENSION = 'KHR_gaussian_splatting';

/** Builds the JSON and its one buffer. Clouds are written as they are: in glTF's frame. */
export function buildGltf(
  meshes: readonly (readonly GltfPrimitive[])[],
  nodes: readonly GltfNode[],
  roots: readonly number[],
): { json: Json; buffer: Buffer } {
  const chunks: Buffer[] = [];
  const bufferViews: Json[] = [];
  const accessors: Json[] = [];
  let at = 0;
  const addView = (bytes: Uint8Array): number => {
    const padded = Buffer.concat([bytes, Buffer.alloc(-bytes.length & 3)]);
    bufferViews.push({ buffer: 0, byteOffset: at, byteLength: bytes.length });
    chunks.push(padded);
    at += padded.length;
    return bufferViews.length - 1;
  };
  const addAccessor = (values: Float32Array, width: number): number => {
    const bytes = new Uint8Array(values.buffer, values.byteOffset, values.byteLength);
    const type = width === 1 ? 'SCALAR' : `VEC${width}`;
    accessors.push({ bufferView: addView(bytes), componentType: 5126, count: values.length / width, type });
    return accessors.length - 1;
  };
  const writePrimitive = ({ cloud, spz }: GltfPrimitive): Json => {
    if (spz) {
      const compression = { [`${EXTENSION}_compression_spz_2`]: { bufferView: addView(spz) } };
      return { mode: 0, attributes: {}, extensions: { [EXTENSION]: { kernel: 'ellipse', extensions: compression } } };
    }
    const { count, positions, scales, rotations, opacities, sh, shDegree } = cloud;
    const xyzw = rotations.map((_, k) => rotations[4 * Math.floor(k / 4) + ((k + 1) % 4)]);
    const attributes: Json = {
      POSITION: addAccessor(positions, 3),
      [`${EXTENSION}:SCALE`]: addAccessor(scales, 3),
      [`${EXTENSION}:ROTATION`]: addAccessor(xyzw, 4),
      [`${EXTENSION}:OPACITY`]: addAccessor(opacities, 1),
    };
    const stride = 3 * (shDegree + 1) ** 2;
    for (let degree = 0, k = 0; degree <= shDegree; degree++) {
      for (let c = 0; c <= 2 * degree; c++, k++) {
        const values = Float32Array.from(
          { length: 3 * count },
          (_, n) => sh[stride * Math.floor(n / 3) + 3 * k + (n % 3)],
        );
        attributes[`${EXTENSION}:SH_DEGREE_${degree}_COEF_${c}`] = addAccessor(values, 3);
      }
    }
    return {
      mode: 0,
      attributes,
      extensions: { [EXTENSION]: { kernel: 'ellipse', colorSpace: 'srgb_rec709_display' } },
    };
  };
  const json = {
    asset: { version: '2.0' },
    extensionsUsed: [EXTENSION],
    scene: 0,
    scenes: [{ nodes: roots }],
    nodes,
    meshes: meshes.map((primitives) => ({ primitives: primitives.map(writePrimitive) })),
    accessors,
    bufferViews,
    buffers: [{ byteLength: at }],
  };
  return { json, buffer: Buffer.concat(chunks) };
}

/** The same JSON and buffer with all buffer views compressed by meshoptimizer. Elements are vectors of float32. */
export async function withMeshopt(
  json: Json,
  buffer: Uint8Array,
  extension: string,
): Promise<{ json: Json; buffer: Buffer }> {
  await MeshoptEncoder.ready;
  const widths: Readonly<Record<string, number>> = { SCALAR: 1, VEC3: 3, VEC4: 4 };
  const accessors = json.accessors as { bufferView: number; count: number; type: string }[];
  const chunks: Uint8Array[] = [];
  let at = 0;
  const bufferViews = (json.bufferViews as { byteOffset: number; byteLength: number }[]).map((view, k) => {
    const { count, type } = accessors.find(({ bufferView }) => bufferView === k)!;
    const byteStride = 4 * widths[type];
    const own = new Uint8Array(buffer.subarray(view.byteOffset, view.byteOffset + view.byteLength));
    const packed = MeshoptEncoder.encodeGltfBuffer(own, count, byteStride, 'ATTRIBUTES');
    const place = { buffer: 0, byteOffset: at, byteLength: packed.length, byteStride, count, mode: 'ATTRIBUTES' };
    chunks.push(packed, new Uint8Array(-packed.length & 3));
    at += packed.length + (-packed.length & 3);
    return { buffer: 1, byteOffset: view.byteOffset, byteLength: view.byteLength, extensions: { [extension]: place } };
  });
  const fallback = { byteLength: buffer.length, extensions: { [extension]: { fallback: true } } };
  const used = { extensionsUsed: [...(json.extensionsUsed as string[]), extension], extensionsRequired: [extension] };
  return {
    json: { ...json, ...used, bufferViews, buffers: [{ byteLength: at }, fallback] },
    buffer: Buffer.concat(chunks),
  };
}

export function writeGlb(json: Json, buffer: Uint8Array): Uint8Array {
  const text = Buffer.from(JSON.stringify(json));
  const padded = Buffer.concat([text, Buffer.alloc(-text.length & 3, ' ')]);
  const header = Buffer.alloc(20);
  header.write('glTF', 'latin1');
  header.writeUInt32LE(2, 4);
  header.writeUInt32LE(28 + padded.length + buffer.length, 8);
  header.writeUInt32LE(padded.length, 12);
  header.write('JSON', 16, 'latin1');
  const chunk = Buffer.alloc(8);
  chunk.writeUInt32LE(buffer.length, 0);
  chunk.write('BIN\0', 4, 'latin1');
  return new Uint8Array(Buffer.concat([header, padded, chunk, buffer]));
}
