/**
 * S16. Shader compilers that err.
 *
 * Who fails: renderers that trust them: Firefox on Direct3D 12 transposed matrices read through a pointer (PlayCanvas #9148), naga refused storage pointers (#8784,
 * #8450): a wrong image, or none.
 *
 * Recipe: asked for a self-test of 64 splats in less than 10 ms. Run with shaders broken on purpose; on a CPU the test takes longer, and the figure is recorded.
 *
 * Passes: shaders are broken on purpose, one after another: the variant concerned fails its self-test and the next takes over with the right image; if no variant is right, that is an error with a code instead of a wrong image.
 */
import { test } from 'node:test';
import assert from 'node:assert/strict';
import { autotune, GaussianBuffers, packGaussians, type Variants } from '@gaussian-splat/renderer';
import { passesSelfTest } from '@gaussian-splat/renderer/stages';
import { offCenter } from '../support/scenes.js';
import type { Miscompilation } from '../support/miscompilation.js';
import { faultyDevice, fullDevice } from './support/devices.js';
import { compareImage, resized, truth } from './support/images.js';
import { capture, Renderer } from '../support/renderer.js';
import { fullTest, holds, note, sized } from './support/row.js';

/** Damage that a compiler does to a stage, and the variant that must replace it. */
const FAULTS: readonly { name: string; fault: Miscompilation; expected: Partial<Variants> }[] = [
  {
    name: 'the sort that needs no barriers loses a digit',
    fault: { shader: /sort_count_serial/, from: 'DIGITS - 1u', to: '127u' },
    expected: { threads: 'parallel' },
  },
  {
    name: 'quads are painted without their slope',
    fault: { shader: /rasterize_quads/, from: 'offset.y - slope * offset.x', to: 'offset.y' },
    expected: { rasterizer: 'tiles' },
  },
];

async function drawAsChosen(device: GPUDevice): Promise<number> {
  const { cloud, cameras } = offCenter();
  const camera = resized(cameras[0], 96);
  await autotune(device);
  const renderer = new Renderer(device);
  const gaussians = await GaussianBuffers.upload(device, packGaussians(cloud));
  const { psnr } = compareImage(await capture(device, renderer, { gaussians, camera }), truth(cloud, camera));
  renderer.destroy();
  gaussians.destroy();
  return psnr;
}

// The second alone in npm test: with barriers SwiftShader is slow.
for (const { name, fault, expected } of sized(FAULTS.slice(1), FAULTS)) {
  test(name, async () => {
    const { device, befallen } = await faultyDevice([fault]);
    const chosen = await autotune(device, { store: null });
    assert.ok(befallen.length > 0, 'the shader was broken');
    for (const [setting, value] of Object.entries(expected))
      assert.equal(chosen[setting as keyof Variants], value, setting);
    holds('S16', `${name}: the variant that takes over`, await drawAsChosen(device), { atLeast: 59, unit: 'dB' });
    device.destroy();
  });
}

fullTest('a choice that was kept from an earlier visit is tried again, and dropped', async () => {
  const { device } = await faultyDevice([FAULTS[1].fault]);
  const kept = JSON.stringify({ rasterizer: 'quads', accumulation: 'rgba16float', threads: 'parallel' });
  const store = { getItem: () => kept, setItem: () => undefined };
  assert.equal((await autotune(device, { store })).rasterizer, 'tiles');
  device.destroy();
});

test('matrices transposed in every variant: an error, not a wrong image', async () => {
  const { device, befallen } = await faultyDevice([
    { shader: /gs\./, from: 'return to_camera * (', to: 'return transpose(to_camera) * (' },
  ]);
  await assert.rejects(autotune(device, { store: null }), { code: 'unsupported/wrong-image' });
  await assert.rejects(autotune(device), { code: 'unsupported/wrong-image' }, 'and again, without a second probe');
  assert.ok(befallen.includes('gs.project'), befallen.join());
  device.destroy();
});

test('the self-test takes little time', async () => {
  const device = await fullDevice();
  const variants = { rasterizer: 'quads', accumulation: 'rgba16float', threads: 'serial' } as const;
  assert.ok(await passesSelfTest(device, variants));
  let best = Infinity;
  for (let i = 0; i < sized(3, 10); i++) {
    const start = performance.now();
    await passesSelfTest(device, variants);
    best = Math.min(best, performance.now() - start);
  }
  note('S16', 'self-test of 64 splats, pipelines compiled', best, { unit: 'ms' });
});
