/**
 * How far the two orders that KHR_gaussian_splatting knows are apart: by z, as trainers and we have it, and by the distance to the camera. Decision 23 rests on these figures.
 */
import assert from 'node:assert/strict';
import { test } from 'node:test';
import { eyeOf, type Camera, type GaussianCloud } from '@gaussian-splat/core';
import { readScene } from '@gaussian-splat/formats';
import { referenceViews } from '../support/cameras.js';
import { hasSharedData, needsSharedData, sharedFile } from '../support/data.js';
import { onlyInLab } from '../support/extent.js';
import { psnr } from '../support/metrics.js';
import { renderOracle, toRgba } from './oracle.js';

function distances({ positions, origin, count }: GaussianCloud, camera: Camera): Float32Array {
  const eye = eyeOf(camera.worldToCamera);
  return Float32Array.from({ length: count }, (_, i) =>
    Math.hypot(...[0, 1, 2].map((axis) => positions[3 * i + axis] + origin[axis] - eye[axis])),
  );
}

/** The same view with a field of view as wide as for the inside of a room: orders differ more to the sides. */
const wide = (camera: Camera): Camera => ({ ...camera, fx: camera.fx / 2, fy: camera.fy / 2 });

test('order by z and by distance', { skip: onlyInLab || needsSharedData }, async (context) => {
  if (!hasSharedData) return;
  const clouds = new Map<string, GaussianCloud>();
  const found: number[] = [];
  for (const view of referenceViews()) {
    const cloud = clouds.get(view.file) ?? (await readScene(sharedFile(view.file), { name: view.file }));
    clouds.set(view.file, cloud);
    for (const [what, camera] of [
      ['as trained', view.camera],
      ['twice as wide', wide(view.camera)],
    ] as const) {
      const options = { rules: 'gsplat', mode: 'classic' } as const;
      const byZ = toRgba(renderOracle(cloud, camera, options));
      const byDistance = toRgba(renderOracle(cloud, camera, { ...options, depthKeys: distances(cloud, camera) }));
      const decibels = psnr(byZ, byDistance);
      context.diagnostic(`${view.name}, ${what}: ${decibels.toFixed(1)} dB`);
      found.push(decibels);
    }
  }
  // They are other images: neither is within the 59 dB that the default promises.
  assert.ok(Math.min(...found) < 59, `${Math.min(...found)} dB`);
  assert.ok(Math.min(...found) > 20, `${Math.min(...found)} dB`);
});
