/**
 * Settings of single frames: the same image as from a renderer with these settings as options, without new resources.
 */
import assert from 'node:assert/strict';
import { after, test } from 'node:test';
import { GaussianBuffers, packGaussians, type PerFrameSettings, type RasterizerName } from '@gaussian-splat/renderer';
import { requestNodeAdapter } from '../../packages/cli/src/lib/node-gpu.mjs';
import { cloudOf, repeat } from '../support/clouds.js';
import { randomSource } from '../support/gpu.js';
import { psnr } from '../support/metrics.js';
import { asOnSwiftShader, endNodeDevice, serialDevice } from '../support/node-device.js';
import { readFrame } from '../support/read-frame.js';
import { cameraAt } from '../support/scenes.js';
import { countWork } from '../support/work-counters.js';
import { Renderer } from '../support/renderer.js';

const MIXES: readonly Partial<PerFrameSettings>[] = [
  { depthKeyBits: 16, resolutionScale: 0.6, shDegree: 0 },
  { resolutionScale: 0.35, depthKeyBits: 16, transmittanceMin: 0.05 },
];

const size = { width: 144, height: 70 };
const random = randomSource(7);
const cloud = cloudOf(
  repeat(1500, () => ({
    position: [random() - 0.5, random() - 0.5, random() - 0.5],
    scale: 0.01 + 0.04 * random(),
    opacity: 0.1 + 0.85 * random(),
    color: [random(), random(), random()],
    sh: Array.from({ length: 9 }, () => 0.4 * (random() - 0.5)),
  })),
  1,
);
/** Turned frame by frame, so that the visible splats are sorted. */
const views = Array.from({ length: 3 }, (_, k) => cameraAt([0.6 + 0.2 * k, -0.5, -1.6], [0, 0, 0], size));

const isSame = (a: Float32Array, b: Float32Array): boolean => a.length === b.length && a.every((v, i) => v === b[i]);

for (const rasterizer of ['quads', 'tiles'] as RasterizerName[]) {
  // Every mix of shader settings is seconds of compiling for tiles here.
  const mixes = rasterizer === 'quads' ? MIXES : MIXES.slice(1);
  test(`${rasterizer}: a frame's settings draw what a renderer of those settings draws, and the next frame without is whole`, async () => {
    const device = await serialDevice();
    const gaussians = await GaussianBuffers.upload(device, packGaussians(cloud));
    const own = new Renderer(device, { rasterizer });
    const plain = new Renderer(device, { rasterizer });
    for (const settings of mixes) {
      const fixed = new Renderer(device, { rasterizer, ...settings });
      for (const camera of views) {
        const mixed = await readFrame(device, own, { gaussians, camera, settings: settings });
        const expected = await readFrame(device, fixed, { gaussians, camera });
        assert.ok(
          mixed.some((value) => value > 0.1),
          'something is in view',
        );
        assert.ok(isSame(mixed, expected), `${JSON.stringify(settings)}: ${psnr(mixed, expected, { channels: 4 })} dB`);
      }
      const whole = await readFrame(device, own, { gaussians, camera: views[0] });
      assert.ok(isSame(whole, await readFrame(device, plain, { gaussians, camera: views[0] })), 'the next frame');
      fixed.destroy();
    }
    for (const renderer of [own, plain]) renderer.destroy();
    gaussians.destroy();
  });

  test(`${rasterizer}: once prepared and seen, steps allocate and compile nothing`, async () => {
    // Tiles take seconds to compile here: those of the test before are good enough for them.
    const isFresh = rasterizer === 'quads';
    const device = isFresh
      ? await asOnSwiftShader(await (await requestNodeAdapter()).requestDevice())
      : await serialDevice();
    const gaussians = await GaussianBuffers.upload(device, packGaussians(cloud));
    const renderer = new Renderer(device, { rasterizer });
    const format = 'rgba8unorm';
    // Usages of an element's canvas: drawing, and storing by tiles.
    const target = device.createTexture({ size: [size.width, size.height], format, usage: 0x18 });
    const made: string[] = [];
    renderer.prepare(mixes, format);
    const makers = ['createComputePipeline', 'createComputePipelineAsync', 'createRenderPipeline'] as const;
    for (const name of [...makers, 'createShaderModule'] as const) {
      const original = device[name].bind(device) as (descriptor: never) => never;
      Object.assign(device, { [name]: (descriptor: never) => (made.push(name), original(descriptor)) });
    }
    const draw = (settings?: Partial<PerFrameSettings>): void => {
      for (const camera of views) renderer.render({ gaussians, camera, target, settings: settings });
    };
    draw();
    made.length = 0;
    for (const settings of mixes) draw(settings);
    assert.deepEqual(made, [], 'pipelines of prepared settings');
    const counter = countWork(device);
    counter.take();
    const before = renderer.byteLength;
    for (const settings of [...mixes, undefined, ...mixes]) draw(settings);
    assert.equal(counter.take().bytesAllocated, 0);
    assert.equal(renderer.byteLength, before);
    renderer.destroy();
    gaussians.destroy();
    if (isFresh) device.destroy();
  });
}

test('a smaller frame is enlarged the same by a compute shader as by drawing', async () => {
  const device = await serialDevice();
  const gaussians = await GaussianBuffers.upload(device, packGaussians(cloud));
  const tiles = new Renderer(device, { rasterizer: 'tiles' });
  const counter = countWork(device);
  const background = [0.1, 0.2, 0.3, 0.5] as const;
  for (const settings of MIXES) {
    const request = { gaussians, camera: views[0], background, settings: settings };
    counter.take();
    const stored = await readFrame(device, tiles, request);
    assert.equal(counter.take().renderPasses, 0, 'stored');
    const drawn = await readFrame(device, tiles, request, GPUTextureUsage.RENDER_ATTACHMENT);
    assert.equal(counter.take().renderPasses, 1, 'drawn');
    const worst = stored.reduce((max, value, i) => Math.max(max, Math.abs(value - drawn[i])), 0);
    assert.ok(stored.some((value) => value > 0.6) && worst < 1e-5, `${JSON.stringify(settings)}: ${worst}`);
  }
  tiles.destroy();
  gaussians.destroy();
});

test('a setting out of range is refused', async () => {
  const renderer = new Renderer(await serialDevice());
  assert.throws(() => renderer.prepare([{ resolutionScale: 0 }], 'rgba8unorm'), { code: 'argument/value' });
  renderer.destroy();
});

test('unknown values of a setting are refused', async () => {
  const device = await serialDevice();
  const renderer = new Renderer(device);
  const refused = (settings: object) => [
    () => new Renderer(device, settings),
    () => renderer.prepare([settings], 'rgba8unorm'),
  ];
  const ofFrames = [0, 8, 20, 40, -8, 'x'].map((depthKeyBits) => ({ depthKeyBits }));
  const degrees = [-1, 0.5, 1.5, 4, NaN].map((shDegree) => ({ shDegree }));
  for (const settings of [...ofFrames, ...degrees]) {
    for (const use of refused(settings)) assert.throws(use, { code: 'argument/value' }, JSON.stringify(settings));
  }
  const names = { rasterizer: 'tile', threads: 'many', accumulation: 'rgba8unorm' };
  for (const [name, found] of Object.entries(names)) {
    assert.throws(() => new Renderer(device, { [name]: found }), { code: 'argument/value', found });
  }
  assert.throws(() => packGaussians(cloud, { sh: 'int4' as 'int8' }), { code: 'argument/value', found: 'int4' });
  renderer.destroy();
});

after(endNodeDevice);
