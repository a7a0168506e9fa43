/**
 * Stages that compute a number again on which another stage's decision depends: a compiler may round it differently in
 * each.
 */
import { packGaussians } from '@gaussian-splat/renderer';
import { layouts } from '@gaussian-splat/renderer/stages';
import { cloudOf, repeat } from '../../support/clouds.js';
import { check, type Bench, type StageCase } from '../../support/gpu.js';
import { miscompiling, type Miscompilation } from '../../support/miscompilation.js';
import { cameraAt } from '../../support/scenes.js';
import { cullOnGpu, projectOnGpu } from './projection.js';

/** World units; coordinates of this and small multiples of it are exact in float32, so that all splats lie on the plane. */
const NEAR = 2 ** -10;
const COUNT = 40;

const onTheNearPlane = cloudOf(
  repeat(COUNT, (i) => ({
    position: [((i % 8) - 4) * (NEAR / 16), (Math.floor(i / 8) - 2) * (NEAR / 16), NEAR],
    scale: [NEAR, 0.3 * NEAR, 0.1 * NEAR],
    opacity: 0.8,
    color: [0.5, 0.5, 0.5],
  })),
);
const camera = cameraAt([0, 0, 0], [0, 0, 1], { width: 64, height: 48, near: NEAR });

/** A depth that is smaller by a fraction of the near plane's distance: a rounding for coordinates 2^23 times as large. */
const nearer = (share: number): Miscompilation => ({
  shader: /gs\.project/,
  from: 'in_camera(view, g.position);',
  to: `in_camera(view, g.position) - vec3f(0.0, 0.0, ${share} * view.near);`,
});

async function checkInFront(bench: Bench, share: number): Promise<void> {
  const packed = packGaussians(onTheNearPlane);
  const { visible } = await cullOnGpu(bench, packed, camera);
  check(visible.filter(Boolean).length === COUNT, `only ${visible.filter(Boolean).length} splats passed`);
  const { device, befallen } = miscompiling(bench.device, [nearer(share)]);
  const [exact, shifted] = [
    await projectOnGpu(bench, packed, camera),
    await projectOnGpu(bench, packed, camera, device),
  ];
  check(befallen.length === 1, 'the shader was changed');
  const words = layouts.ProjectedSplat.size / 4;
  for (let k = 0; k < words * COUNT; k++) {
    check(shifted.splats[k] === exact.splats[k], `splat ${Math.floor(k / words)}, word ${k % words}`);
  }
}

export const roundedApartCases: readonly StageCase[] = [0.25, 1, 1.5].map((share) => ({
  name: `project: what culling passed at the near plane stays there, found nearer by ${share} of its distance`,
  run: (bench) => checkInFront(bench, share),
}));
