/**
 * S19. Off-centre, wide, narrow, mirrored and sheared views.
 *
 * Who fails: a symmetric clamp of the Jacobian is wrong for an off-centre principal point (gsplat made its own asymmetric); PlayCanvas #8889 culled with one eye's frustum
 * in XR; the camera's center taken from a transposed matrix is wrong when the view is sheared.
 *
 * Recipe: asked for fields of view from 5 to 160 degrees, lens shifts, sheared and mirrored views, orthographic ones. Run with 500 random cameras for each
 * rasterizer; tests/golden/world.alone.test.ts draws orthographic projections.
 *
 * Passes: 59 dB or more for fields of view from 5 to 160 degrees, any lens shift, any invertible view.
 */
import { test } from 'node:test';
import fc from 'fast-check';
import { eyeOf, multiply, type Camera } from '@gaussian-splat/core';
import { cloudOf, repeat } from '../support/clouds.js';
import { nodeDevice } from '../support/node-device.js';
import { seededRandom } from '../support/random.js';
import { cameraAt } from '../support/scenes.js';
import { toCamera } from '../oracle/projection.js';
import { compare, RASTERIZERS } from './support/images.js';
import { holds, sized } from './support/row.js';

const random = seededRandom(19);
const cloud = cloudOf(
  repeat(600, () => ({
    position: [random.uniform(-2, 2), random.uniform(-2, 2), random.uniform(-2, 2)],
    scale: [random.logUniform(0.02, 0.4), random.logUniform(0.02, 0.4), random.logUniform(0.02, 0.4)],
    rotation: random.rotation(),
    opacity: random.uniform(0.05, 1),
    color: [random.uniform(0, 1), random.uniform(0, 1), random.uniform(0, 1)],
    sh: Array.from({ length: 45 }, () => 0.2 * random.normal()),
  })),
  3,
);

const share = fc.double({ min: -1, max: 1, noNaN: true });
const matrix = fc
  .record({ mirror: fc.boolean(), shear: fc.tuple(share, share, share), stretch: fc.tuple(share, share, share) })
  .map(({ mirror, shear, stretch }) => [
    ...[(mirror ? -1 : 1) * 2 ** stretch[0], 0.5 * shear[0], 0.5 * shear[1], 0],
    ...[0, 2 ** stretch[1], 0.5 * shear[2], 0],
    ...[0, 0, 2 ** stretch[2], 0],
    ...[0, 0, 0, 1],
  ]);
const view = fc.record({
  fovDegrees: fc.oneof(fc.constantFrom(5, 160), fc.double({ min: 5, max: 160, noNaN: true })),
  shift: fc.tuple(share, share),
  aspect: fc.double({ min: 0.3, max: 3, noNaN: true }),
  eye: fc.tuple(share, share, share).filter((p) => Math.hypot(...p) > 0.2),
  matrix: fc.option(matrix, { nil: undefined }),
});

for (const rasterizer of RASTERIZERS) {
  test(`any camera, ${rasterizer}`, async () => {
    const device = await nodeDevice();
    let [worst, offCenter] = [Infinity, 0];
    await fc.assert(
      fc.asyncProperty(view, async ({ fovDegrees, shift, aspect, eye, matrix }) => {
        const base = cameraAt([4 * eye[0], 4 * eye[1], 4 * eye[2]], [0.1, 0.2, 0], {
          width: 72,
          height: 54,
          fovXDegrees: fovDegrees,
        });
        const camera: Camera = {
          ...base,
          fy: base.fy * aspect,
          cx: base.cx + shift[0] * base.width,
          cy: base.cy + shift[1] * base.height,
          worldToCamera: matrix ? multiply(matrix, base.worldToCamera) : base.worldToCamera,
        };
        offCenter = Math.max(offCenter, Math.hypot(...toCamera(camera, eyeOf(camera.worldToCamera))));
        const { psnr } = await compare(device, cloud, camera, { rasterizer });
        worst = Math.min(worst, psnr);
        return psnr >= 59;
      }),
      { numRuns: rasterizer === 'quads' ? sized(25, 500) : sized(6, 500), seed: 19 },
    );
    holds('S19', `cameras at random, ${rasterizer}, worst`, worst, { atLeast: 59, unit: 'dB' });
    holds('S19', 'distance of the eye from which colors are evaluated to the reference', offCenter, {
      atMost: 1e-9,
      unit: 'units',
    });
  });
}
