import { GaussianSplatError, type GaussianCloud } from '@gaussian-splat/core';
import { alignedTo4, grouped } from '../bytes.js';
import { allocateCloud, SH_C0 } from '../cloud.js';
import { looksLikeSplats, SPLAT_BYTES } from '../splat/plausible.js';
import type { SceneSource } from '../scene-format.js';

/**
 * Reads antimatter15's `.splat`, which has no header and no view-dependent color. A splat has 32 bytes: position and
 * standard deviations in float32, RGBA in bytes, and the quaternion (w, x, y, z) in bytes as 128 + 128·q.
 */
export function readSplat(source: SceneSource): GaussianCloud {
  const { name } = source;
  const count = Math.floor(source.bytes.length / SPLAT_BYTES);
  const rest = source.bytes.length % SPLAT_BYTES;
  const bytes = source.bytes.subarray(0, SPLAT_BYTES * count);
  // A line end after the last splat is accepted.
  const isLineEnd = source.bytes.subarray(bytes.length).every((byte) => byte === 10 || byte === 13);
  if (!source.isPrefix && !isLineEnd) {
    throw new GaussianSplatError('decode/truncated', {
      where: `${name}, byte ${grouped(source.bytes.length)} (end of the file)`,
      expected: 'a multiple of 32 bytes, as .splat files have',
      found: `${grouped(count)} whole splats and ${rest} bytes of another`,
      remedy: 'download or export the file again; it is incomplete, or not a .splat file',
    });
  }
  if (!looksLikeSplats(bytes, 'at least half')) {
    throw new GaussianSplatError('decode/corrupt', {
      where: `${name}, bytes 0 to ${grouped(bytes.length)}`,
      expected: 'finite positions and positive scales in records of 32 bytes',
      found: 'other numbers in most records',
      remedy: 'check that the file really is a .splat file; its name says so, but its content does not',
    });
  }
  const cloud = allocateCloud(count, 0, source);
  const body = alignedTo4(bytes);
  const floats = new Float32Array(body.buffer, body.byteOffset, body.length / 4);
  for (let i = 0; i < count; i++) {
    const color = SPLAT_BYTES * i + 24;
    for (let k = 0; k < 3; k++) {
      cloud.positions[3 * i + k] = floats[8 * i + k];
      cloud.scales[3 * i + k] = floats[8 * i + 3 + k];
      cloud.sh[3 * i + k] = (body[color + k] / 255 - 0.5) / SH_C0;
    }
    cloud.opacities[i] = body[color + 3] / 255;
    for (let k = 0; k < 4; k++) cloud.rotations[4 * i + k] = (body[color + 4 + k] - 128) / 128;
  }
  return cloud;
}
