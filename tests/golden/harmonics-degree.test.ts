/** The setting `shDegree`: scenes of any degree, stored either way, drawn up to any other, are those whose higher coefficients are zeros. */
import assert from 'node:assert/strict';
import { after, test } from 'node:test';
import { shCoefficientCount, type GaussianCloud, type ShDegree } from '@gaussian-splat/core';
import { GaussianBuffers, packGaussians } from '@gaussian-splat/renderer';
import { renderOracle } from '../oracle/oracle.js';
import { cloudOf, repeat } from '../support/clouds.js';
import { closeness } from '../support/compare.js';
import { anyDevice, endNodeDevice } from '../support/node-device.js';
import { seededRandom } from '../support/random.js';
import { cameraAt } from '../support/scenes.js';
import { capture, Renderer } from '../support/renderer.js';

const DEGREES: readonly ShDegree[] = [0, 1, 2, 3];
const camera = cameraAt([0.7, -0.9, -3], [0, 0, 0], { width: 72, height: 54 });

function scene(degree: ShDegree): GaussianCloud {
  const random = seededRandom(12);
  const within = (reach: number): number => random.uniform(-reach, reach);
  const splats = repeat(600, () => ({
    position: [within(1.5), within(1.2), within(1)] as const,
    scale: random.logUniform(0.05, 0.3),
    opacity: random.uniform(0.2, 1),
    color: [random.uniform(0, 1), random.uniform(0, 1), random.uniform(0, 1)] as const,
    sh: Array.from({ length: 45 }, () => within(0.3)),
  }));
  return cloudOf(splats, degree);
}

/** The same without the coefficients above a degree. */
function cutAt(cloud: GaussianCloud, degree: ShDegree): GaussianCloud {
  const [own, kept] = [cloud.shDegree, degree].map((d) => 3 * shCoefficientCount(d as ShDegree));
  return { ...cloud, sh: cloud.sh.map((x, i) => (i % own < kept ? x : 0)) };
}

for (const precision of ['int8', 'float16'] as const) {
  for (const stored of DEGREES) {
    test(`degree ${stored} as ${precision}`, async () => {
      const device = await anyDevice();
      const cloud = scene(stored);
      const gaussians = await GaussianBuffers.upload(device, packGaussians(cloud, { sh: precision }));
      const renderer = new Renderer(device, { rasterizer: 'quads' });
      for (const shDegree of DEGREES) {
        const pixels = await capture(device, renderer, { gaussians, camera, settings: { shDegree } });
        const oracle = renderOracle(cutAt(cloud, shDegree), camera, { rules: 'gsplat', mode: 'classic' });
        const { psnr } = closeness(pixels, oracle);
        assert.ok(psnr >= 59, `up to degree ${shDegree}: ${psnr} dB`);
      }
      renderer.destroy();
      gaussians.destroy();
    });
  }
}

after(endNodeDevice);
