/** Many faint splats one behind another: what each adds is less than a step of float16. */
import assert from 'node:assert/strict';
import { after, test } from 'node:test';
import type { GaussianCloud } from '@gaussian-splat/core';
import { requestNodeAdapter } from '../../packages/cli/src/lib/node-gpu.mjs';
import { someOf } from '../support/extent.js';
import { cloudOf, repeat } from '../support/clouds.js';
import { compareWithOracle } from '../support/compare.js';
import { anyDevice, asOnSwiftShader, endNodeDevice } from '../support/node-device.js';
import { cameraAt } from '../support/scenes.js';
import type { RendererOptions } from '../support/renderer.js';

const camera = cameraAt([0, 0, -3], [0, 0, 0], { width: 64, height: 64 });

const HAZES = [100, 500, 1000];

const hazeAlone = (splats: number): GaussianCloud =>
  cloudOf(repeat(splats, (i) => ({ position: [0, 0, i / splats], scale: 1, opacity: 0.006, color: [0.9, 0.6, 0.3] })));

/** Haze of nearly the color of the wall behind it: quads are blended from there to the front, each in steps of the stored value. The wall leaves some light, or it would end the pixel, which quads cannot. */
function hazeBeforeWall(splats: number): GaussianCloud {
  const wall = { position: [0, 0, 17], scale: [30, 30, 0.01], opacity: 0.99, color: [0.5, 0.5, 0.5] } as const;
  const faint = { scale: 8, opacity: 0.006, color: [0.55, 0.58, 0.52] } as const;
  return cloudOf([wall, ...repeat(splats, (i) => ({ ...faint, position: [0, 0, 0.01 * i] as const }))]);
}

const SCENES = { alone: hazeAlone, 'before a wall': hazeBeforeWall };
const CASES = Object.entries(SCENES).flatMap(([name, make]) =>
  HAZES.filter((splats) => make === hazeAlone || splats < 1000).map((splats) => ({
    name: `haze of ${splats}, ${name}`,
    cloud: make(splats),
  })),
);

async function closeness(device: GPUDevice, cloud: GaussianCloud, options: RendererOptions): Promise<number> {
  return (await compareWithOracle(device, cloud, camera, 'classic', options)).psnr;
}

test('quads that blend in float32 keep haze', async (t) => {
  const adapter = await requestNodeAdapter();
  if (!adapter.features.has('float32-blendable')) return t.skip('no float32-blendable here');
  const device = await asOnSwiftShader(await adapter.requestDevice({ requiredFeatures: ['float32-blendable'] }));
  for (const { name, cloud } of CASES) {
    const psnr = await closeness(device, cloud, { rasterizer: 'quads', accumulation: 'rgba32float' });
    console.log(`${name}: quads in float32 ${psnr.toFixed(1)} dB`);
    assert.ok(psnr >= 75, `${name}: ${psnr} dB`);
  }
  device.destroy();
});

test('the figures of docs/stability.md: quads in float16, and tiles', async () => {
  const device = await anyDevice();
  for (const { name, cloud } of someOf(CASES, 2)) {
    const quads = await closeness(device, cloud, { rasterizer: 'quads', accumulation: 'rgba16float' });
    const tiles = await closeness(device, cloud, { rasterizer: 'tiles' });
    console.log(`${name}: quads in float16 ${quads.toFixed(1)} dB, tiles ${tiles.toFixed(1)} dB`);
    assert.ok(tiles >= 75, `${name}: ${tiles} dB`);
  }
});

after(endNodeDevice);
