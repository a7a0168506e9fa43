/**
 * S17. Optional features that are missing.
 *
 * Who fails: Visionary needs shader-f16, which Chrome on Linux with NVIDIA hides ("Ubuntu is not supported" in its README); sorts that need subgroups; targets that
 * need float32-blendable.
 *
 * Recipe: asked for features taken away one by one. Run so, and all at once.
 *
 * Passes: with every optional feature removed, one by one and all together, at default limits, the image is the same; only the precision of blending may follow
 * float32-blendable.
 */
import { test } from 'node:test';
import assert from 'node:assert/strict';
import { deviceDescriptor, GaussianBuffers, packGaussians } from '@gaussian-splat/renderer';
import { requestNodeAdapter } from '../../packages/cli/src/lib/node-gpu.mjs';
import { offCenter } from '../support/scenes.js';
import { deviceWith } from './support/devices.js';
import { compareImage, differingBytes, RASTERIZERS, resized, truth } from './support/images.js';
import { holds, sized } from './support/row.js';
import { shaderTexts } from './support/sources.js';
import { capture, Renderer } from '../support/renderer.js';

test('each feature removed, then all', async () => {
  const adapter = await requestNodeAdapter();
  const useful = [...(deviceDescriptor(adapter).requiredFeatures ?? [])] as GPUFeatureName[];
  const others = (['timestamp-query', 'subgroups', 'shader-f16', 'indirect-first-instance'] as GPUFeatureName[]).filter(
    (f) => adapter.features.has(f),
  );
  const all = [...useful, ...others];
  // Each set is a device, whose pipelines take seconds to make: npm test has all features and none.
  const sets = [
    all,
    ...sized(
      [],
      all.map((left) => all.filter((feature) => feature !== left)),
    ),
    [],
  ];
  const { cloud, cameras } = offCenter();
  const camera = resized(cameras[0], 96);
  const oracle = truth(cloud, camera);
  const first = new Map<string, Float32Array>();
  let [differing, worst] = [0, Infinity];
  for (const features of sets) {
    const device = await deviceWith(features);
    device.pushErrorScope('validation');
    const gaussians = await GaussianBuffers.upload(device, packGaussians(cloud));
    // Tiles, whose pipelines take seconds to make on each device, are drawn with all features and with none.
    const isEnd = features.length === 0 || features === all;
    for (const rasterizer of sized(false, isEnd) ? RASTERIZERS : RASTERIZERS.slice(0, 1)) {
      const renderer = new Renderer(device, { rasterizer });
      const pixels = await capture(device, renderer, { gaussians, camera });
      worst = Math.min(worst, compareImage(pixels, oracle).psnr);
      const known = first.get(rasterizer);
      if (known) differing += differingBytes(known, pixels);
      else first.set(rasterizer, pixels);
      renderer.destroy();
    }
    assert.equal(
      await device.popErrorScope(),
      null,
      `validation without ${all.filter((f) => !features.includes(f)).join(', ')}`,
    );
    device.destroy();
  }
  holds('S17', `${sets.length} sets of features: differing bytes`, differing, { atMost: 0, unit: 'bytes' });
  holds('S17', `${sets.length} sets of features, worst`, worst, { atLeast: 59, unit: 'dB' });
});

test('no shader enables an extension', () => {
  const users = [...shaderTexts()].filter(([, text]) => /^\s*(?:enable|requires)\s/m.test(text)).map(([name]) => name);
  assert.deepEqual(users, []);
});

test('what needs a missing feature is refused by name', async () => {
  const device = await deviceWith([]);
  assert.throws(() => new Renderer(device, { rasterizer: 'quads', accumulation: 'rgba32float' }), {
    code: 'unsupported/limits',
  });
  device.destroy();
});
