/** Streamed scenes with quantized geometry: their error against the original values, and that shaders read the written values. */
import assert from 'node:assert/strict';
import { readFileSync } from 'node:fs';
import { after, test } from 'node:test';
import { boundsOf, type Camera, type GaussianCloud, type Vector3 } from '@gaussian-splat/core';
import { readScene } from '@gaussian-splat/formats';
import { GaussianBuffers, packGaussians, StreamedGaussians } from '@gaussian-splat/renderer';
import {
  constants,
  leafLevel,
  packQuantizedChunk,
  pageLayout,
  QUANTIZED_CHUNK_WORDS,
  type SplatLevel,
} from '@gaussian-splat/renderer/stages';
import { buildDetailTree } from '@gaussian-splat/optimize/pages';
import { needsSharedData, sharedFile } from '../support/data.js';
import { detailFolder } from '../support/detail-folder.js';
import { onlyInLab, someOf } from '../support/extent.js';
import { drawUntilCalm } from '../support/draw-until-calm.js';
import { randomSource } from '../support/gpu.js';
import { psnr } from '../support/metrics.js';
import { anyDevice, endNodeDevice } from '../support/node-device.js';
import { readQuantizedChunk } from '../support/quantized-twin.js';
import { readFrame } from '../support/read-frame.js';
import { cameraAt } from '../support/scenes.js';
import { pebbles } from '../support/scenes/pebbles.js';
import { Renderer } from '../support/renderer.js';

after(endNodeDevice);

const { CULL_GROUP } = constants;
/** Exact painting, so that only quantized values differ. */
const serial = { threads: 'serial', sort: 'serial', rasterizer: 'tiles' } as const;
/** Pages come with any rasterizer: quads are several times as fast here. */
const fast = { threads: 'serial', rasterizer: 'quads' } as const;
const quantized = { geometry: 'quantized' } as const;

const around = (cloud: GaussianCloud, distance: number, angle = 0.5): Camera => {
  const { center: c, radius } = boundsOf(cloud);
  const r = distance * radius;
  const eye: Vector3 = [c[0] + r * Math.cos(angle), c[1] - 0.3 * r, c[2] + r * Math.sin(angle)];
  return cameraAt(eye, c, { width: 120, height: 80, fovXDegrees: 60, near: 0.01 });
};

/** Leaves of a random shape and size, sheets and needles among them. */
function randomLevel(count: number, seed: number): SplatLevel {
  const random = randomSource(seed);
  const factors = Float32Array.from({ length: 6 * count }, (_, n) => {
    const size = 10 ** (-4 * random()) * (random() < 0.2 ? 1e-3 : 1);
    return [0, 2, 5].includes(n % 6) ? size * (random() < 0.2 ? -1 : 1) : size * (2 * random() - 1);
  });
  const level = leafLevel(
    pebbles(count),
    Uint32Array.from({ length: count }, (_, i) => i),
  );
  const opacities = Float32Array.from({ length: count }, () => Math.E * random() ** 3);
  return { ...level, factors, opacities };
}

const covariance = (l: ArrayLike<number>): number[] => [
  l[0] * l[0],
  l[0] * l[1],
  l[1] * l[1] + l[2] * l[2],
  l[0] * l[3],
  l[1] * l[3] + l[2] * l[4],
  l[3] * l[3] + l[4] * l[4] + l[5] * l[5],
];

for (const count of [1, 2, 255, 256]) {
  test(`${count} splats come back as they were, to the stated steps`, () => {
    const level = randomLevel(300, count);
    const words = new Uint32Array(10 + QUANTIZED_CHUNK_WORDS);
    packQuantizedChunk(level, words, 10, 7, 7 + count);
    const [low, high] = [0, 1, 2]
      .map((axis) => {
        const own = Array.from({ length: count }, (_, k) => level.positions[3 * (7 + k) + axis]);
        return [Math.min(...own), Math.max(...own)];
      })
      .reduce(
        ([lows, highs], [min, max]) => [
          [...lows, min],
          [...highs, max],
        ],
        [[], []] as number[][],
      );
    readQuantizedChunk(words, 10, CULL_GROUP).forEach(({ position, factor, opacity }, k) => {
      const i = 7 + k;
      if (k >= count) return assert.equal(opacity, 0, 'what fills up the chunk shows');
      position.forEach((x, axis) => {
        const error = Math.abs(x - level.positions[3 * i + axis]);
        assert.ok(error <= (high[axis] - low[axis]) / 131_000 + 1e-7, `center of ${k}: ${error}`);
      });
      assert.ok(Math.abs(opacity - level.opacities[i]) <= 1 / 2900);
      assert.equal(opacity >= 1 / 255, level.opacities[i] >= 1 / 255);
      const asked = covariance(level.factors.subarray(6 * i, 6 * i + 6));
      const found = covariance(factor);
      const sizes = [asked[0], asked[2], asked[5]].map(Math.sqrt);
      [
        [0, 0],
        [0, 1],
        [1, 1],
        [0, 2],
        [1, 2],
        [2, 2],
      ].forEach(([a, b], n) => {
        const error = Math.abs(found[n] - asked[n]) / (sizes[a] * sizes[b]);
        assert.ok(error < 0.022, `covariance ${n} of ${k}: off by ${error}`);
      });
      return undefined;
    });
  });
}

test('splats without any size along an axis, and chunks of one size, stay what they are', () => {
  const level = randomLevel(3, 5);
  const flat = { ...level, count: 3, factors: Float32Array.of(1, 0, 1, 0, 0, 0, 1, 0, 1, 0, 0, 0, 1, 0, 1, 0, 0, 0) };
  const ball = { ...flat, factors: Float32Array.from(flat.factors, (_, n) => ([0, 2, 5].includes(n % 6) ? 0.25 : 0)) };
  const words = new Uint32Array(2 * QUANTIZED_CHUNK_WORDS);
  packQuantizedChunk(flat, words, 0, 0, 3);
  packQuantizedChunk(ball, words, QUANTIZED_CHUNK_WORDS, 0, 3);
  for (const { factor } of readQuantizedChunk(words, 0, 3)) {
    assert.ok(factor.every(Number.isFinite));
    [1, 0, 1, 0, 0].forEach((x, n) => assert.ok(Math.abs(factor[n] - x) < 1e-5, `${factor}`));
    assert.ok(factor[5] < 1e-6);
  }
  for (const { factor } of readQuantizedChunk(words, QUANTIZED_CHUNK_WORDS, 3)) {
    factor.forEach((x, n) => assert.ok(Math.abs(x - ball.factors[n]) < 1e-7, `${factor}`));
  }
});

/** PSNR in dB between a streamed scene with all pages resident and the scene that was loaded whole. */
async function closenessOf(cloud: GaussianCloud, distances: readonly number[], options: object): Promise<number[]> {
  const device = await anyDevice();
  const folder = detailFolder(cloud, undefined, quantized);
  const whole = await GaussianBuffers.upload(device, packGaussians(cloud));
  const scene = await StreamedGaussians.open(device, folder.manifest, { fetchPage: folder.fetchPage, arrivalMs: 0 });
  const [streaming, loaded] = [new Renderer(device, options), new Renderer(device, options)];
  const fetching = new Renderer(device, fast);
  const found: number[] = [];
  for (const distance of distances) {
    const camera = around(cloud, distance, distance);
    await drawUntilCalm(scene, fetching, camera, 0);
    const expected = await readFrame(device, loaded, { gaussians: whole, camera, detail: 0 });
    const drawn = await readFrame(device, streaming, { gaussians: scene, camera, detail: 0 });
    found.push(psnr(expected, drawn, { channels: 4 }));
  }
  assert.equal(scene.progress.resident, scene.progress.total);
  [fetching, streaming, loaded, scene, whole].forEach((owner) => owner.destroy());
  return found;
}

const skull = (): Promise<GaussianCloud> => readScene(readFileSync('demo/scenes/skull.spz'), { name: 'skull.spz' });

test('the included scene has 66 dB or more against its quantized data, with any sort and cull', async () => {
  const near = await closenessOf(await skull(), [0.6, 1.6], serial);
  const parallel = await closenessOf(pebbles(4_000), [1.2], { rasterizer: 'tiles' });
  console.log(`${[...near, ...parallel].map((db) => db.toFixed(1)).join(', ')} dB`);
  assert.ok(Math.min(...near, ...parallel) > 66);
});

test('captured scenes are 66 dB and more from what was quantized', { skip: needsSharedData || onlyInLab }, async () => {
  for (const file of ['formats/playbot3.ply', 'scenes/massa.sog']) {
    const openFile = async (path: string): Promise<Uint8Array> => sharedFile(path);
    const cloud = await readScene(sharedFile(file), { name: file, openFile });
    const found = await closenessOf(cloud, [0.6, 1.6], serial);
    console.log(`${file}: ${found.map((db) => db.toFixed(1)).join(', ')} dB`);
    assert.ok(Math.min(...found) > 66);
  }
});

/** Stones with splats far off at a regular stride, as sky and floaters of captures are. */
function scattered(count: number, every: number, distance: number): GaussianCloud {
  const cloud = pebbles(count);
  const random = randomSource(every);
  for (let i = 0; i < 3 * count; i++) {
    if (Math.floor(i / 3) % every === 1) cloud.positions[i] += distance * (2 * random() - 1);
  }
  return cloud;
}

const SCATTERED = [
  [4_000, 4_000, 1e6],
  [4_000, 400, 1e4],
  [4_000, 20, 300],
  [600, 60, 1e5],
] as const;

for (const [count, every, distance] of someOf(SCATTERED, 2)) {
  test(`of ${count} splats every ${every}th ${distance} units off: what is near by stays 66 dB and more from what it was`, async () => {
    const found = await closenessOf(scattered(count, every, distance), [0.6, 1.6], serial);
    console.log(`${found.map((db) => db.toFixed(1)).join(', ')} dB`);
    assert.ok(Math.min(...found) > 66, `${found}`);
  });
}

test('what fills up chunks is no splat of the scene, and errors of coarser levels count what their centers are rounded by', () => {
  for (const [count, every, distance] of SCATTERED) {
    const tree = buildDetailTree(scattered(count, every, distance), quantized);
    assert.equal(tree.splats, count);
    const [leaves, ...coarser] = tree.levels;
    assert.ok(leaves.count > count && leaves.opacities.filter((opacity) => opacity > 0).length === count);
    coarser.forEach((level, k) => {
      for (let first = 0; first < level.count; first += CULL_GROUP) {
        const end = Math.min(level.count, first + CULL_GROUP);
        const words = new Uint32Array(QUANTIZED_CHUNK_WORDS);
        packQuantizedChunk(level, words, 0, first, end);
        const off = readQuantizedChunk(words, 0, end - first).map(({ position }, n) =>
          Math.hypot(...position.map((x, axis) => x - level.positions[3 * (first + n) + axis])),
        );
        const said = tree.errors[k + 1].errors[first / CULL_GROUP];
        const max = Math.max(...off);
        assert.ok(2 * max <= 1.001 * said, `level ${k + 1}, chunk ${first / CULL_GROUP}: ${2 * max}, ${said} said`);
      }
    });
  }
});

test('copies that are moved on the GPU, and coarser levels, are what exact pages show', async () => {
  const device = await anyDevice();
  const cloud = pebbles(4_000);
  const places = [0, 1, 2, 3, 4, 5].map((k) => [14.3 * (k % 3), 0.7 * k, 14 * (k >> 1)] as const);
  const [renderer, fetching] = [new Renderer(device, serial), new Renderer(device, fast)];
  for (const [distance, detail] of [
    [1.2, 0.67],
    [4, 0.47],
    [9, 1.33],
  ]) {
    const camera = around(cloud, distance, 0.8);
    const [exact, small] = await Promise.all(
      [{}, quantized].map(async (options) => {
        const { manifest, fetchPage } = detailFolder(cloud, places, options);
        const scene = await StreamedGaussians.open(device, manifest, { fetchPage, arrivalMs: 0 });
        await drawUntilCalm(scene, fetching, camera, detail);
        const image = await readFrame(device, renderer, { gaussians: scene, camera, detail });
        const { visible } = await renderer.stats();
        scene.destroy();
        return { image, visible };
      }),
    );
    const close = psnr(exact.image, small.image, { channels: 4 });
    console.log(`at ${distance}: ${close.toFixed(1)} dB, ${exact.visible} and ${small.visible} visible`);
    assert.ok(exact.visible > 500 && Math.abs(exact.visible - small.visible) < 0.01 * exact.visible);
    assert.ok(close > 60, `${close} dB`);
  }
  [renderer, fetching].forEach((owner) => owner.destroy());
});

test('chunks whose first rows make no sense are not drawn, and spoil nothing else', async () => {
  const device = await anyDevice();
  const cloud = pebbles(3_000);
  const { manifest, files } = detailFolder(cloud, undefined, quantized);
  const [renderer, fetching] = [new Renderer(device, serial), new Renderer(device, fast)];
  const camera = around(cloud, 1.2);
  const layout = pageLayout(manifest, 1);
  const spoilt = manifest.trees[0].pages[1];
  const at = spoilt.chunks * (layout.chunks + layout.details);
  for (const [word, value] of [
    [0, 0x7fc00000],
    [3, 0x7f800000],
    [4, 0xff800001],
    [5, 0x7f7fffff],
    [7, 0x42c80000],
    [3, 0xc2c80000],
  ]) {
    const fetchPage = async (file: string): Promise<ArrayBuffer> => {
      const words = new Uint32Array(files.get(file)!.slice(0));
      // Every other chunk.
      for (let c = 1; file === spoilt.file && c < spoilt.chunks; c += 2)
        words[at + c * QUANTIZED_CHUNK_WORDS + word] = value;
      return words.buffer;
    };
    const scene = await StreamedGaussians.open(device, manifest, { fetchPage, arrivalMs: 0 });
    await drawUntilCalm(scene, fetching, camera, 0);
    const image = await readFrame(device, renderer, { gaussians: scene, camera, detail: 0 });
    assert.ok(image.every(Number.isFinite), `word ${word}`);
    const { unusable, visible } = await renderer.stats();
    assert.ok(unusable > 500 && visible > 300, `word ${word}: ${unusable} refused, ${visible} visible`);
    scene.destroy();
  }
  [renderer, fetching].forEach((owner) => owner.destroy());
});

test('half of the bytes of geometry', () => {
  const [exact, small] = [undefined, 'quantized' as const].map((geometry) =>
    pageLayout({ shDegree: 0, shPrecision: 'int8', geometry }, 4),
  );
  assert.ok(small.geometry <= 0.51 * exact.geometry);
});
