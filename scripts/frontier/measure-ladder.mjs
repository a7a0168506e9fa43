/**
 * The work behind `npm run frontier:ladder`: what each rung of pictures in motion (packages/element/src/pace/ladder.ts) takes and loses, and fewer pixels alone for
 * comparison, in Node. A GPU tells its own time. SwiftShader is a processor: its time is what it used of the processor, which others on the machine hardly change.
 */
import { readFileSync, writeFileSync } from 'node:fs';
import { join } from 'node:path';
import { boundsOf, cameraFromCalibration, lookAt } from '@gaussian-splat/core';
import { readScene } from '@gaussian-splat/formats';
import {
  capture,
  deviceDescriptor,
  GaussianBuffers,
  packGaussians,
  Renderer,
  SpanTimer,
} from '@gaussian-splat/renderer';
import { LADDER } from '../../packages/element/dist/pace/ladder.js';
import { requestNodeAdapter } from '../lib/node-gpu.mjs';
import { root } from '../lib/run.mjs';

const SCENE = 'demo/scenes/skull.spz';
const [WIDTH, HEIGHT, FOCAL] = [480, 270, 300];
/** Frames of a rung in each round; the first fills caches and does not count. The camera turns, so that splats are sorted. */
const [FRAMES, ROUNDS] = [3, 4];
const UNCOUNTED = 1;

const adapter = await requestNodeAdapter();
const device = await adapter.requestDevice(deviceDescriptor(adapter));
const isProcessor = /swiftshader/i.test(`${adapter.info.architecture} ${adapter.info.description}`);
const cloud = await readScene(new Uint8Array(readFileSync(join(root, SCENE))), { name: SCENE });
const gaussians = await GaussianBuffers.upload(device, packGaussians(cloud));
// What `Renderer.create` finds there, without the minute that looking for it takes.
const ofProcessor = { rasterizer: 'quads', accumulation: 'rgba32float', threads: 'serial' };
const renderer = isProcessor ? new Renderer(device, ofProcessor) : await Renderer.create(device);
const target = device.createTexture({ size: [WIDTH, HEIGHT], format: 'rgba8unorm', usage: 0x10 });

/** A camera at a step of a turn around the scene, 0.5 degrees each, as near as to fill the height. */
function cameraAt(step) {
  const { center, radius } = boundsOf(cloud);
  const angle = (step * Math.PI) / 360;
  const eye = [
    center[0] + 1.1 * radius * Math.sin(angle),
    center[1] - 0.5 * radius,
    center[2] - 1.1 * radius * Math.cos(angle),
  ];
  const m = lookAt(eye, center, [0, -1, 0]);
  const K = [
    [FOCAL, 0, WIDTH / 2],
    [0, FOCAL, HEIGHT / 2],
    [0, 0, 1],
  ];
  const worldToCamera = [0, 1, 2, 3].map((row) => [...m.slice(4 * row, 4 * row + 4)]);
  return cameraFromCalibration({ width: WIDTH, height: HEIGHT, K, worldToCamera }, 'ladder');
}

/** Milliseconds of one frame. */
async function time(levers, step, timer) {
  let span;
  const isTimed = timer?.expect((milliseconds) => (span = milliseconds));
  const before = process.cpuUsage();
  renderer.render({ gaussians, camera: cameraAt(step), target, levers, timer: isTimed ? timer : undefined });
  await device.queue.onSubmittedWorkDone();
  const { user, system } = process.cpuUsage(before);
  if (!timer) return (user + system) / 1000;
  for (let tries = 0; span === undefined && tries < 100; tries++)
    await new Promise((resolve) => setTimeout(resolve, 2));
  return span ?? NaN;
}

/** dB over covered pixels. */
function decibels(image, reference) {
  let [sum, pixels] = [0, 0];
  for (let i = 0; i < reference.length; i += 4) {
    if (reference[i + 3] === 0) continue;
    pixels++;
    for (let c = i; c < i + 3; c++) sum += (image[c] - reference[c]) ** 2;
  }
  return -10 * Math.log10(sum / (3 * pixels));
}

const fewerPixels = [0.84, 0.5].map((resolutionScale) => ({
  name: `whole at ${resolutionScale}`,
  levers: { resolutionScale },
}));
const rungs = [...LADDER, ...fewerPixels].map(({ name, levers }) => ({ name, levers, times: [] }));
const timer = isProcessor ? undefined : new SpanTimer(device);
// To and fro, so that no rung is always first.
for (let round = 0; round < ROUNDS; round++) {
  for (const rung of round % 2 ? [...rungs].reverse() : rungs) {
    for (let k = 0; k < FRAMES; k++) {
      const spent = await time(rung.levers, k, timer);
      if (k >= UNCOUNTED && spent > 0) rung.times.push(spent);
    }
  }
}
const views = [20];
const results = rungs.map(({ name, levers, times }) => ({
  name,
  levers,
  ms: Number(Math.min(...times).toFixed(2)),
  psnr: Infinity,
}));
for (const step of views) {
  // Sorted for the view at hand, as pictures in motion are.
  const draw = async (levers) => {
    for (const before of [1]) await capture(device, renderer, { gaussians, camera: cameraAt(step - before), levers });
    return capture(device, renderer, { gaussians, camera: cameraAt(step), levers });
  };
  const whole = await draw(undefined);
  for (const result of results) {
    if (result.levers)
      result.psnr = Math.min(result.psnr, Number(decibels(await draw(result.levers), whole).toFixed(2)));
  }
}
const { rasterizer, accumulation, threads } = renderer.levers;
const report = {
  kind: 'ladder',
  date: new Date().toISOString(),
  adapter: isProcessor ? 'SwiftShader' : adapter.info.description,
  clock: isProcessor ? 'processor time of a frame, least of all' : "the GPU's span, least of all",
  scene: {
    path: SCENE,
    splats: cloud.count,
    width: WIDTH,
    height: HEIGHT,
    views: views.length,
    variants: { rasterizer, accumulation, threads },
  },
  rungs: results.map(({ psnr, ...rest }) => ({ ...rest, psnr: Number.isFinite(psnr) ? psnr : null })),
};
const slug = report.adapter
  .toLowerCase()
  .replace(/[^a-z0-9]+/g, '-')
  .slice(0, 40);
const path = join(root, `docs/frontier/ladder-${slug}.json`);
writeFileSync(path, `${JSON.stringify(report, null, 2)}\n`);
console.log(`${report.adapter}: ${report.clock}; dB to the first rung, ${views.length} view`);
for (const { name, ms, psnr } of report.rungs) {
  console.log(
    `${name.padEnd(14)}${ms.toFixed(2).padStart(9)} ms  ${(ms / report.rungs[0].ms).toFixed(2)}  ${psnr === null ? '' : `${psnr.toFixed(1)} dB`}`,
  );
}
console.log(path);
// Dawn keeps Node alive.
process.exit(0);
