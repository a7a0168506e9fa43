/** Visible sets: that what a side shows is noted and nothing else, that frames drawn from the sets are true, and take few splats that show nothing. */
import assert from 'node:assert/strict';
import { after, test } from 'node:test';
import { boundsOf, lookAt, type Camera, type Vector3 } from '@gaussian-splat/core';
import { decibels, lookAround, meanSquare, visibleSetsDecibels } from '@gaussian-splat/economise';
import {
  capture,
  GaussianBuffers,
  MemoryLedger,
  packedOrder,
  packGaussians,
  Renderer,
  SidedGaussians,
  SIDES,
  sidesNear,
  type GaussianScene,
  type HeldScene,
} from '@gaussian-splat/renderer';
import { cloudOf, repeat } from '../support/clouds.js';
import { randomSource } from '../support/gpu.js';
import { serialDevice } from '../support/node-device.js';
import { cameraAt } from '../support/scenes.js';
import { cpuScorer } from './twin/index.js';

const SIZE = 40;
/** Half a step of 255. */
const SHOWS = 0.5 / 255;
const random = randomSource(5);

function onSphere(radius: number): Vector3 {
  const [x, y, z] = [random() - 0.5, random() - 0.5, random() - 0.5];
  const scale = radius / Math.hypot(x, y, z);
  return [x * scale, y * scale, z * scale];
}

/** An opaque ball of 600 splats, 200 within it that nobody sees, and one far away in the background. */
function ball(): Parameters<typeof cloudOf>[0] {
  const splat = (radius: number, scale: number) => () => ({
    position: onSphere(radius),
    scale,
    opacity: 0.99,
    color: [random(), random(), random()] as [number, number, number],
  });
  const background = { position: [0, 60, 0] as const, scale: 0.5, opacity: 0.9, color: [1, 1, 1] as const };
  const splats = [...repeat(600, splat(1, 0.2)), ...repeat(200, splat(0.3, 0.02)), background];
  return splats as unknown as Parameters<typeof cloudOf>[0];
}

const splats = ball();
const cloud = cloudOf(splats);
/** In two pages, as on a device with small limits. */
const halves = [cloudOf(splats.slice(0, 400)), cloudOf(splats.slice(400))];
const { center, radius } = boundsOf(cloud);
const around = { center, radius };

async function upload(device: GPUDevice): Promise<HeldScene> {
  const parts: GaussianBuffers[] = [];
  for (const half of halves) parts.push(await GaussianBuffers.upload(device, packGaussians(half)));
  const [{ shDegree, shPrecision, antialiased, origin }] = parts;
  const pages = parts.flatMap((part) => part.pages);
  const destroy = (): void => parts.forEach((part) => part.destroy());
  const byteLength = parts.reduce((sum, part) => sum + part.byteLength, 0);
  return { count: cloud.count, shDegree, shPrecision, antialiased, origin, version: 0, pages, byteLength, destroy };
}

let looked: Promise<SidedGaussians> | undefined;
/** The scene with its sets: to look at it from all sides takes SwiftShader some seconds. */
function sidedScene(device: GPUDevice): Promise<SidedGaussians> {
  looked ??= upload(device).then((scene) => lookAround(device, scene, around, { size: SIZE }));
  return looked;
}

/** [128] by number in the cloud: whether each splat shows from the side. */
async function readSets(device: GPUDevice, { pages }: GaussianScene): Promise<boolean[][]> {
  const sets = SIDES.map((): boolean[] => []);
  for (const [half, { seenFrom, count }] of pages.entries()) {
    const staging = device.createBuffer({ size: seenFrom!.size, usage: 0x1 | 0x8 });
    const encoder = device.createCommandEncoder();
    encoder.copyBufferToBuffer(seenFrom!, 0, staging, 0, seenFrom!.size);
    device.queue.submit([encoder.finish()]);
    await staging.mapAsync(0x1);
    const words = new Uint32Array(staging.getMappedRange().slice(0));
    staging.destroy();
    const [row, first] = [words.length / 4, half * halves[0].count];
    const order = packedOrder(halves[half]);
    sets.forEach((shows, side) => {
      for (let slot = 0; slot < count; slot++)
        shows[first + order[slot]] = ((words[(side >>> 5) * row + slot] >>> (side & 31)) & 1) === 1;
    });
  }
  return sets;
}

test('the sides near a camera are the seven nearest, whatever way it looks; none among the splats', () => {
  for (let k = 0; k < 200; k++) {
    const direction = onSphere(1);
    const distance = radius * (1 + 5 * random());
    const eye = direction.map((value, axis) => center[axis] + distance * value) as unknown as Vector3;
    const bits = sidesNear({ worldToCamera: lookAt(eye, onSphere(3), [0, -1, 0]) }, around);
    const likeness = SIDES.map((side) => side.reduce((sum, value, axis) => sum + value * direction[axis], 0));
    const nearest = [...likeness.keys()].sort((a, b) => likeness[b] - likeness[a]).slice(0, 7);
    const found = [...likeness.keys()].filter((side) => (bits[side >>> 5] >>> (side & 31)) & 1);
    assert.deepEqual(
      found,
      nearest.sort((a, b) => a - b),
    );
    // All of them are around the camera: none is farther than two steps of the lattice.
    assert.ok(Math.min(...found.map((side) => likeness[side])) > Math.cos(0.55));
  }
  const inside = lookAt([center[0] + 0.5 * radius, center[1], center[2]], [5, 0, 0], [0, -1, 0]);
  assert.deepEqual([...sidesNear({ worldToCamera: inside }, around)], [0, 0, 0, 0]);
});

test('each side notes what its two pictures show, and what they do not reach', async () => {
  const device = await serialDevice();
  const sets = await readSets(device, await sidedScene(device));
  const scorer = cpuScorer(cloud);
  let [shown, differing] = [0, 0];
  for (let side = 0; side < SIDES.length; side += 9) {
    const weights = new Float32Array(cloud.count);
    for (const [distance, tangent] of [
      [1.3, 1.2],
      [2.6, 0.7],
    ]) {
      const { peak } = await scorer(pictureFrom(SIDES[side], distance, tangent));
      peak.forEach((weight, i) => (weights[i] = Math.max(weights[i], weight)));
    }
    // The splat of the background is in no picture but those that look along its axis.
    if (Math.abs(SIDES[side][1]) < 0.8) assert.ok(sets[side][cloud.count - 1], `side ${side}: the background`);
    for (let i = 0; i < cloud.count - 1; i++) {
      shown += +sets[side][i];
      // Rounding may decide at the threshold.
      if (Math.abs(weights[i] - SHOWS) < 0.02 * SHOWS) continue;
      differing += +(sets[side][i] !== weights[i] >= SHOWS);
    }
  }
  const mean = shown / Math.ceil(SIDES.length / 9);
  console.log(`a side shows ${mean.toFixed(0)} of ${cloud.count - 1} splats; ${differing} differ from the twin`);
  assert.ok(mean > 150 && mean < 450, 'about half of the ball, and nothing within');
  assert.equal(differing, 0);
});

/** The picture that a side is noted in, set up by itself. */
function pictureFrom(direction: Vector3, distance: number, tangent: number): Camera {
  const eye = direction.map((value, axis) => center[axis] + distance * radius * value) as unknown as Vector3;
  const up: Vector3 = Math.abs(direction[1]) > 0.9 ? [0, 0, -1] : [0, -1, 0];
  const focal = SIZE / 2 / tangent;
  return {
    ...{ width: SIZE, height: SIZE, fx: focal, fy: focal, cx: SIZE / 2, cy: SIZE / 2, near: radius / 100, far: 1e10 },
    worldToCamera: lookAt(eye, center, up),
  };
}

test('frames from the sets leave out what is hidden, and keep 55 dB; without the lever they are the same to the byte', async () => {
  const device = await serialDevice();
  const sided = await sidedScene(device);
  const both = sided.whole;
  const exact = new Renderer(device, { rasterizer: 'tiles' });
  const some = new Renderer(device, { rasterizer: 'tiles', visibleSets: true });
  for (let view = 0; view < 5; view++) {
    const eye = onSphere((2.2 + view / 2) * radius).map((value, axis) => value + center[axis]) as unknown as Vector3;
    const camera = cameraAt(eye, center, { width: 96, height: 64 });
    const expected = await capture(device, exact, { gaussians: both, camera });
    assert.deepEqual(await capture(device, exact, { gaussians: sided, camera }), expected, 'without the lever');
    const image = await capture(device, some, { gaussians: sided, camera });
    const [{ visible }, { visible: all }] = [await some.readStatistics(), await exact.readStatistics()];
    const weights = await weightsIn(device, exact, both, camera);
    const showing = weights.filter((weight) => weight >= SHOWS).length;
    const found = decibels(meanSquare(image, expected));
    console.log(`${visible} splats for ${showing} that show, ${found.toFixed(1)} dB`);
    assert.ok(found > 55, `${found} dB`);
    assert.ok(visible >= showing && visible < 0.7 * all, `${visible} of ${all} for ${showing}`);
  }
  const figure = await visibleSetsDecibels(device, sided, boundsOf(cloud), { viewSize: { width: 96, height: 54 } });
  console.log(`${figure.toFixed(1)} dB in views of its own`);
  assert.ok(figure > 55, `${figure} dB`);
  // From within all are drawn.
  const inside = cameraAt([0.2, 0, 0], [0, 0, 5], { width: 96, height: 64 });
  const expected = await capture(device, exact, { gaussians: both, camera: inside });
  assert.deepEqual(await capture(device, some, { gaussians: sided, camera: inside }), expected, 'from within');
  [exact, some].forEach((renderer) => renderer.destroy());
});

test('splats that are smaller than a pixel of the pictures are not taken for hidden', async () => {
  const device = await serialDevice();
  const fine = { ...cloudOf(splats.slice(0, 600).map((splat) => ({ ...splat, scale: 0.01 }))), antialiased: true };
  const gaussians = await GaussianBuffers.upload(device, packGaussians(fine));
  // A pixel is a tenth of the ball, and the splats a hundredth: each has some hundredth of its opacity left.
  const sided = await lookAround(device, gaussians, around, { size: 24 });
  const [exact, some] = [false, true].map((visibleSets) => new Renderer(device, { rasterizer: 'tiles', visibleSets }));
  const camera = cameraAt([1.6 * radius, 0.3, 0.4], center, { width: 160, height: 120 });
  const expected = await capture(device, exact, { gaussians, camera });
  const found = decibels(meanSquare(await capture(device, some, { gaussians: sided, camera }), expected));
  console.log(`splats of a tenth of a pixel: ${found.toFixed(1)} dB from nearby`);
  assert.ok(found > 55, `${found} dB`);
  [exact, some].forEach((renderer) => renderer.destroy());
  sided.destroy();
});

async function weightsIn(
  device: GPUDevice,
  renderer: Renderer,
  gaussians: GaussianScene,
  camera: Camera,
): Promise<Float32Array> {
  const slots = gaussians.pages.reduce((sum, { count }) => sum + 256 * Math.ceil(count / 256), 0);
  const contributions = device.createBuffer({ size: 4 * slots, usage: 0x80 | 0x4 });
  const staging = device.createBuffer({ size: 4 * slots, usage: 0x1 | 0x8 });
  await capture(device, renderer, { gaussians, camera, notes: { contributions } });
  const encoder = device.createCommandEncoder();
  encoder.copyBufferToBuffer(contributions, 0, staging, 0, 4 * slots);
  device.queue.submit([encoder.finish()]);
  await staging.mapAsync(0x1);
  const weights = new Float32Array(staging.getMappedRange().slice(0));
  [contributions, staging].forEach((buffer) => buffer.destroy());
  return weights;
}

test('sets are reserved before they are allocated, given back, and given up with the signal', async () => {
  const device = await serialDevice();
  const ledger = MemoryLedger.of(device);
  const gaussians = await GaussianBuffers.upload(device, packGaussians(cloud));
  const before = ledger.bytes;
  const sided = await SidedGaussians.of(device, gaussians, around);
  assert.equal(ledger.bytes - before, sided.setBytes);
  // 16 bytes a splat, in whole chunks.
  assert.equal(sided.setBytes, 16 * 256 * Math.ceil(cloud.count / 256));
  // Nobody has looked yet: nothing shows from anywhere, and the figure says so.
  const figure = await visibleSetsDecibels(device, sided, boundsOf(cloud), { viewSize: { width: 48, height: 32 } });
  assert.ok(figure < 20, `${figure} dB of a scene without any splat`);
  sided.release();
  assert.equal(ledger.bytes, before);
  await assert.rejects(
    lookAround(device, gaussians, around, { memoryBudget: 100 }),
    /out-of-memory\/budget|at most 100/,
  );
  const signal = AbortSignal.abort(new Error('over'));
  await assert.rejects(lookAround(device, gaussians, around, { signal }), /over/);
  assert.equal(ledger.bytes, before, 'what was made in vain is gone, the scene is not');
  gaussians.destroy();
});

// Dawn keeps Node alive.
after(() => {
  setImmediate(() => process.exit());
});
