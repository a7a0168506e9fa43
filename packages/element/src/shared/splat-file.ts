import type { Vector3 } from '@gaussian-splat/core';
import type { SceneLoader } from '../loading/scene-loader.js';
import type { LoadedScene } from '../loading/protocol.js';

/** Bytes of a splat in a `.splat` file: position and scale as float32 (24), color and opacity (4), and rotation (4). */
const ROW_BYTES = 32;

/** An axis-aligned splat: its center, its standard deviations, and red, green, blue and opacity, 0..255. */
export type SplatRow = readonly [place: Vector3, scale: Vector3, color: readonly [number, number, number, number]];

/** Returns the bytes of a `.splat` file with splats that the element has created. The axes stay the same. */
export function splatFile(rows: readonly SplatRow[]): ArrayBuffer {
  const view = new DataView(new ArrayBuffer(ROW_BYTES * rows.length));
  rows.forEach(([place, scale, color], i) => {
    const at = ROW_BYTES * i;
    [...place, ...scale].forEach((value, k) => view.setFloat32(at + 4 * k, value, true));
    // The quaternion 1, 0, 0, 0: no rotation.
    [...color, 255, 128, 128, 128].forEach((value, k) => view.setUint8(at + 24 + k, value));
  });
  return view.buffer;
}

/** Packs splats that the element has created, in the same way as a scene file. */
export async function packSplats(
  rows: readonly SplatRow[],
  loader: SceneLoader,
  signal: AbortSignal,
): Promise<LoadedScene['packed']> {
  const url = URL.createObjectURL(new Blob([splatFile(rows)]));
  const request = { url: `${url}#own.splat`, credentials: 'same-origin', sh: 'auto', levels: false } as const;
  const { packed } = await loader.load(request, signal, () => undefined).finally(() => URL.revokeObjectURL(url));
  return packed;
}
