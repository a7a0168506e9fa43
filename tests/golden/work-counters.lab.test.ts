/**
 * How much work a frame is: splats, passes, dispatches, bytes. Times on a shared machine say little; these figures are the
 * same everywhere, so a change that makes a frame more expensive is seen by its author.
 * `UPDATE_WORK_COUNTERS=1 npm test -- work-counters` writes work-counters.json again.
 */
import assert from 'node:assert/strict';
import { readFileSync, writeFileSync } from 'node:fs';
import { after, test } from 'node:test';
import { fileURLToPath } from 'node:url';
import {
  DynamicGaussians,
  GaussianBuffers,
  packGaussians,
  StreamedGaussians,
  type GaussianScene,
} from '@gaussian-splat/renderer';
import { packWithDetail } from '@gaussian-splat/renderer/tools';
import { requestNodeAdapter } from '../../packages/cli/src/lib/node-gpu.mjs';
import { detailFolder } from '../support/detail-folder.js';
import { writeTensors } from '../support/generator-tensors.js';
import { endNodeDevice } from '../support/node-device.js';
import { cameraAt, room, thinned } from '../support/scenes.js';
import { pebbles } from '../support/scenes/pebbles.js';
import { countWork } from '../support/work-counters.js';
import { Renderer, type RendererOptions } from '../support/renderer.js';

type Figures = Readonly<Record<string, number>>;

const file = fileURLToPath(new URL('work-counters.json', import.meta.url));
const expected = JSON.parse(readFileSync(file, 'utf8')) as Record<string, Figures>;
const found: Record<string, Figures> = {};

/** Passes and calls are exact; results of arithmetic in float32 may differ by this fraction between GPUs. */
const TOLERANCE: Readonly<Record<string, number>> = {
  visible: 0.001,
  pairs: 0.005,
  sceneBytes: 0.01,
  rendererBytes: 0.01,
};

const CONFIGURATIONS: readonly (readonly [name: string, options: RendererOptions])[] = [
  ['quads', { rasterizer: 'quads' }],
  ['tiles', { rasterizer: 'tiles' }],
];

/** A device that counts, for each configuration: what renderers share on a device, pipelines above all, is made once, and counted in the first frame. */
const devices = new Map<string, Promise<CountedDevice>>();

interface CountedDevice {
  readonly device: GPUDevice;
  readonly counter: ReturnType<typeof countWork>;
}

function countedDevice(name: string): Promise<CountedDevice> {
  const open = async (): Promise<CountedDevice> => {
    const device = await (await requestNodeAdapter()).requestDevice();
    return { device, counter: countWork(device) };
  };
  if (!devices.has(name)) devices.set(name, open());
  return devices.get(name)!;
}

/** A frame of the room, after one that allocates and compiles. */
async function measure(name: string, options: RendererOptions): Promise<Figures> {
  const { device, counter } = await countedDevice(name);
  const { cloud, cameras } = room();
  const gaussians = await GaussianBuffers.upload(device, packGaussians(cloud));
  const renderer = new Renderer(device, options);
  const [camera] = cameras;
  const size = [camera.width, camera.height];
  const target = device.createTexture({ size, format: 'rgba8unorm', usage: 0x10 }).createView();
  counter.take();
  const draw = (): void => renderer.render({ gaussians, camera, target, targetFormat: 'rgba8unorm' });
  draw();
  const { buffersCreated, bytesAllocated } = counter.take();
  draw();
  const { buffersCreated: buffersPerFrame, bytesAllocated: bytesPerFrame, ...frame } = counter.take();
  const { visible, ...others } = await renderer.stats();
  const figures = {
    visible,
    ...('pairs' in others ? { pairs: others.pairs as number } : {}),
    ...frame,
    buffersPerFrame,
    bytesPerFrame,
    buffersOfFirstFrame: buffersCreated,
    bytesOfFirstFrame: bytesAllocated,
    sceneBytes: gaussians.byteLength,
    rendererBytes: renderer.byteLength,
  };
  renderer.destroy();
  gaussians.destroy();
  return figures;
}

function assertSame(name: string, figures: Figures): void {
  for (const [figure, before] of Object.entries(expected[name] ?? {})) {
    const now = figures[figure];
    const tolerance = (TOLERANCE[figure] ?? 0) * before;
    assert.ok(
      Math.abs(now - before) <= tolerance,
      `${name}: ${figure} was ${before}, is ${now}. If that is meant, UPDATE_WORK_COUNTERS=1 npm test -- work-counters`,
    );
  }
}

for (const [name, options] of CONFIGURATIONS) {
  test(`work of a frame with ${name}`, async () => {
    found[name] = await measure(name, options);
    console.log(name, JSON.stringify(found[name]));
    assert.equal(found[name].buffersPerFrame, 0, 'a frame creates no buffer');
    assert.equal(found[name].bytesPerFrame, 0, 'a frame allocates nothing');
    assert.equal(found[name].indirectCalls, 0, 'the CPU knows the size of every dispatch and draw');
    assert.ok(found[name].visible > 1000, 'the scene is visible');
    if (process.env.UPDATE_WORK_COUNTERS) return;
    assert.ok(name in expected, `work-counters.json has no figures of ${name}`);
    assertSame(name, found[name]);
  });
}

/** Scenes of every kind that frames are made of. */
const SCENES: Readonly<Record<string, (device: GPUDevice) => Promise<GaussianScene & { destroy(): void }>>> = {
  'a file': (device) => GaussianBuffers.upload(device, packGaussians(thinned(room(), 4000).cloud)),
  'levels of detail': (device) => GaussianBuffers.upload(device, packWithDetail(pebbles(4000))),
  'a streamed scene': (device) => {
    const { manifest, fetchPage } = detailFolder(pebbles(8000), [[0, 0, 0]]);
    return StreamedGaussians.open(device, manifest, { fetchPage });
  },
  'a generator': async (device) => {
    const spec = { layout: 'split', shape: 'log-scale', color: 'channel-major', opacity: 'logit' } as const;
    const { tensors, layout } = writeTensors(thinned(room(), 4000).cloud, {
      ...spec,
      quaternionOrder: 'xyzw',
      dtype: 'float32',
    });
    const scene = await DynamicGaussians.create(device, layout);
    const buffers = Object.entries(tensors).map(([name, words]) => {
      const buffer = device.createBuffer({ size: words.byteLength, usage: 0x88 });
      device.queue.writeBuffer(buffer, 0, words);
      return [name, buffer] as const;
    });
    scene.ingest(Object.fromEntries(buffers), 4000);
    return scene;
  },
};

for (const [name, options] of CONFIGURATIONS) {
  for (const [kind, open] of Object.entries(SCENES)) {
    test(`frames of ${kind} with ${name}: the CPU knows the size of every dispatch and draw`, async () => {
      const { device, counter } = await countedDevice(name);
      const gaussians = await open(device);
      counter.take();
      const renderer = new Renderer(device, { ...options, splatBudget: 3000 });
      const target = device.createTexture({ size: [64, 48], format: 'rgba8unorm', usage: 0x10 });
      // At rest, and turning.
      for (const angle of [0, 0, 0, 0.3, 0.6, 0.9]) {
        const camera = cameraAt([3 * Math.sin(angle), -1, -3 * Math.cos(angle)], [0, 0, 0], {
          width: 64,
          height: 48,
        });
        renderer.render({ gaussians, camera, target });
        await device.queue.onSubmittedWorkDone();
      }
      const { dispatches, indirectCalls } = counter.take();
      assert.ok(dispatches > 30);
      assert.equal(indirectCalls, 0);
      assert.ok((await renderer.stats()).visible > 100, 'something is drawn');
      [renderer, gaussians, target].forEach((owner) => owner.destroy());
    });
  }
}

test('the counter sees what it is there to see', async () => {
  const device = await (await requestNodeAdapter()).requestDevice();
  const counter = countWork(device);
  const buffer = device.createBuffer({ size: 64, usage: 0x8 });
  device.queue.writeBuffer(buffer, 0, new Uint32Array(4));
  const encoder = device.createCommandEncoder();
  encoder.beginComputePass().end();
  device.queue.submit([encoder.finish()]);
  const { submits, computePasses, dispatches, buffersCreated, bytesAllocated, bytesWritten } = counter.take();
  assert.deepEqual(
    { submits, computePasses, dispatches, buffersCreated, bytesAllocated, bytesWritten },
    { submits: 1, computePasses: 1, dispatches: 0, buffersCreated: 1, bytesAllocated: 64, bytesWritten: 16 },
  );
  assert.equal(counter.take().submits, 0, 'and starts again');
});

after(() => {
  if (process.env.UPDATE_WORK_COUNTERS) writeFileSync(file, `${JSON.stringify(found, null, 2)}\n`);
  return endNodeDevice();
});
