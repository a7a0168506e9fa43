/** Coded pages: decoded pages equal pages that are not coded, to the requested steps; and other files are refused. */
import assert from 'node:assert/strict';
import { after, test } from 'node:test';
import { deflateRawSync } from 'node:zlib';
import {
  boundsOf,
  GaussianSplatError,
  shCoefficientCount,
  type GaussianCloud,
  type ShDegree,
} from '@gaussian-splat/core';
import { checkManifest, GaussianBuffers, packGaussians, StreamedGaussians } from '@gaussian-splat/renderer';
import { cloudOfChunks, decodePage } from '@gaussian-splat/renderer/tools';
import { constants, pageLayout } from '@gaussian-splat/renderer/stages';
import {
  buildDetailTree,
  codingFor,
  cutPages,
  manifestOf,
  packPage,
  PageEncoder,
  DEFAULT_STEPS,
  type DetailTree,
  type PageSteps,
  HarmonicRounder,
} from '@gaussian-splat/optimize/pages';
import { deflate } from '../../packages/cli/src/lib/encoders.mjs';
import { someOf } from '../support/extent.js';
import { detailFolder } from '../support/detail-folder.js';
import { drawUntilCalm } from '../support/draw-until-calm.js';
import { randomSource } from '../support/gpu.js';
import { basisOf, cone, rootOf } from '../support/seen-from.js';
import { psnr } from '../support/metrics.js';
import { anyDevice, endNodeDevice } from '../support/node-device.js';
import { readFrame } from '../support/read-frame.js';
import { cameraAt } from '../support/scenes.js';
import { pebbles } from '../support/scenes/pebbles.js';
import { Renderer } from '../support/renderer.js';

after(endNodeDevice);

/** As fine as files can have it. */
const FINE: PageSteps = {
  ...{ place: 0.001, size: 1 / 48, direction: 1 / 255, opacity: 1 / 93, color: 1 / 1000, chroma: 1 / 1000 },
  harmonics: 1 / 1000,
};

/** Colors that depend on the view, those of three channels mostly alike. */
function withHarmonics(cloud: GaussianCloud, shDegree: ShDegree): GaussianCloud {
  const [from, to] = [cloud.shDegree, shDegree].map((degree) => 3 * shCoefficientCount(degree));
  const random = randomSource(9);
  const sh = new Float32Array(to * cloud.count);
  for (let i = 0; i < cloud.count; i++) {
    for (let k = 0; k < to; k += 3) {
      const luma = 0.3 * (random() - 0.5) * random();
      for (let c = 0; c < 3; c++) {
        sh[to * i + k + c] = k === 0 ? cloud.sh[from * i + c] : luma + 0.05 * (random() - 0.5);
      }
    }
  }
  return { ...cloud, shDegree, sh };
}

for (const degree of someOf([3, 2, 1, 0] as const, 2)) {
  test(`degree ${degree}: rows are those of pages that are not coded, and splats are where they were`, async () => {
    const cloud = withHarmonics(pebbles(6_000), degree);
    const tree = buildDetailTree(cloud, { geometry: 'quantized' });
    const coding = codingFor(FINE, tree);
    const encoder = new PageEncoder(tree, coding, { deflate });
    const scene = manifestOf(tree, [], String, coding);
    const parts = [];
    for (const page of cutPages(tree)) {
      const { chunks, upper, holds } = page;
      const file = { chunks, upper, shDegree: degree, coding };
      const words = new Uint32Array(await decodePage('page', encoder.encode(page), file));
      const plain = packPage({ ...tree, shPrecision: 'int8' }, page);
      assert.equal(words.length, plain.length);
      const layout = pageLayout(scene, chunks);
      const rows = (all: Uint32Array): Uint32Array => all.subarray(layout.chunks, layout.chunks + layout.details);
      assert.deepEqual(rows(words), rows(plain), 'spheres, errors and children');
      const [found, asked] = [words, plain].map((all) => new Float32Array(all.buffer, 0, layout.chunks));
      found.forEach((number, k) => {
        const [level] = holds[Math.floor((k * chunks) / layout.chunks)];
        const size = Math.max(1e-3, Math.abs(asked[k]));
        const max = (level === 0 ? 0.03 : 0.05) * size;
        assert.ok(Math.abs(number - asked[k]) <= max, `bound ${k}: ${number}, not ${asked[k]}`);
      });
      const leaves = holds.flatMap(([level], chunk) => (level === 0 ? [chunk] : []));
      parts.push({ words, of: chunks, chunks: leaves });
    }
    const decoded = cloudOfChunks(scene, parts);
    const sums = (values: Float32Array): number => values.reduce((sum, value) => sum + value, 0);
    const visible = tree.levels[0].opacities.filter((opacity) => Math.round(opacity * 93.75) > 0).length;
    assert.equal(decoded.count, visible);
    for (const [found, asked] of [
      [decoded.opacities, cloud.opacities],
      [decoded.scales, cloud.scales],
      [decoded.sh, cloud.sh],
    ]) {
      const max = Math.max(1, sums(asked.map(Math.abs)));
      assert.ok(Math.abs(sums(found) - sums(asked)) < 0.02 * max, `${sums(found)}, not ${sums(asked)}`);
    }
  });
}

test('harmonics of a splat that is seen from one side are rounded to what that side shows: with the same steps, two thirds of the error and no more bits', () => {
  const random = randomSource(4);
  const splats = 400;
  const sh = Float32Array.from({ length: 27 * splats }, (_, k) => (k % 27 < 3 ? 1 : 0.4) * (random() - 0.5));
  const root = rootOf(cone(64, random));
  const roots = Float32Array.from({ length: 45 * splats }, (_, k) => root[k % 45]);
  const seen = { energies: new Float32Array(splats).fill(1), roots };
  const others = cone(64, random).map(basisOf);
  const [plain, fitting] = [undefined, seen].map((reported) => {
    const rounder = new HarmonicRounder(9, reported);
    const step = 0.05;
    const counts = new Map<number, number>();
    let error = 0;
    for (let i = 0; i < splats; i++) {
      assert.ok(rounder.round(sh, 27 * i, i, step));
      // Greens less what lumas and differences say of them.
      const added = [-(rounder.constantShift()[0] + rounder.constantShift()[2] / 2)];
      for (let k = 1; k < 9; k++) {
        const [luma, green] = [rounder.codes[k - 1], rounder.codes[16 + k - 1]];
        added.push(step * (luma + green) - sh[27 * i + 3 * k + 1]);
        counts.set(luma, (counts.get(luma) ?? 0) + 1);
      }
      for (const basis of others) {
        error += basis.reduce((sum, value, k) => sum + value * added[k], 0) ** 2 / (splats * others.length);
      }
    }
    let bits = 0;
    for (const count of counts.values()) bits -= count * Math.log2(count / (8 * splats));
    return { error, bits: bits / splats };
  });
  console.log(`mean squared error ${plain.error.toExponential(2)}, as seen ${fitting.error.toExponential(2)}`);
  assert.ok(fitting.error < 0.67 * plain.error, `${fitting.error} and ${plain.error}`);
  assert.ok(fitting.bits < 1.01 * plain.bits, `${fitting.bits} and ${plain.bits} bits`);
});

test('coarser levels, which are far from the scene anyway, have coarser coordinates and harmonics', async () => {
  const tree = buildDetailTree(withHarmonics(pebbles(6_000), 1), { geometry: 'quantized' });
  const coding = codingFor(DEFAULT_STEPS, tree);
  const encoder = new PageEncoder(tree, coding, { deflate });
  const scene = manifestOf(tree, [], String, coding);
  const steps: number[][] = tree.levels.map(() => []);
  for (const page of cutPages(tree)) {
    const { chunks, upper, holds } = page;
    const file = { chunks, upper, shDegree: 1, coding } as const;
    const words = new Float32Array(await decodePage('page', encoder.encode(page), file));
    const layout = pageLayout(scene, chunks);
    const stride = layout.geometry / chunks;
    holds.forEach(([level], c) => steps[level].push(words[layout.chunks + layout.details + stride * c + 4]));
  }
  const [fine, coarse] = steps.map((own) => own.reduce((sum, step) => sum + step, 0) / own.length);
  assert.ok(coarse > 4 * fine, `${coarse} and ${fine} between two coordinates`);
});

/** A level of a tree, read from its pages. */
async function decodedLevel(tree: DetailTree, steps: PageSteps, wanted: number): Promise<GaussianCloud> {
  const coding = codingFor(steps, tree);
  const encoder = new PageEncoder(tree, coding, { deflate });
  const parts = [];
  for (const page of cutPages(tree)) {
    const { chunks, upper, holds } = page;
    const file = { chunks, upper, shDegree: tree.levels[0].shDegree, coding };
    const words = new Uint32Array(await decodePage('page', encoder.encode(page), file));
    parts.push({ words, of: chunks, chunks: holds.flatMap(([level], chunk) => (level === wanted ? [chunk] : [])) });
  }
  return cloudOfChunks(manifestOf(tree, [], String, coding), parts);
}

test('coarser levels keep the harmonics that show', async () => {
  const tree = buildDetailTree(withHarmonics(pebbles(6_000), 2), { geometry: 'quantized' });
  const [usual, fine] = await Promise.all(
    [DEFAULT_STEPS, FINE].map(async (steps) => {
      const { sh } = await decodedLevel(tree, steps, 1);
      return sh.reduce((sum, value, k) => sum + (k % 27 < 3 ? 0 : value * value), 0);
    }),
  );
  console.log(`energy of the harmonics of the first coarser level: ${(usual / fine).toFixed(2)} of the whole`);
  assert.ok(usual / fine > 0.6 && usual / fine < 1.1, `${usual / fine}`);
});

/** PSNR in dB between a streamed scene with all pages resident and the scene that was loaded whole. */
async function closenessOf(cloud: GaussianCloud, steps: PageSteps): Promise<{ decibels: number; bytes: number }> {
  const device = await anyDevice();
  const { manifest, files, fetchPage } = detailFolder(cloud, undefined, {
    geometry: 'quantized',
    coded: { steps, deflate },
  });
  checkManifest(manifest, 'detail.json');
  const whole = await GaussianBuffers.upload(device, packGaussians(cloud));
  const scene = await StreamedGaussians.open(device, manifest, { fetchPage, arrivalMs: 0 });
  const renderer = new Renderer(device, { threads: 'serial', rasterizer: 'quads' });
  const { center, radius } = boundsOf(cloud);
  const eye = [center[0] + radius, center[1] - 0.3 * radius, center[2] + radius] as const;
  const camera = cameraAt(eye, center, { width: 120, height: 80, fovXDegrees: 60, near: 0.01 });
  await drawUntilCalm(scene, renderer, camera, 0);
  assert.equal(scene.progress.resident, scene.progress.total);
  const [expected, drawn] = [
    await readFrame(device, renderer, { gaussians: whole, camera, detail: 0 }),
    await readFrame(device, renderer, { gaussians: scene, camera, detail: 0 }),
  ];
  [renderer, scene, whole].forEach((owner) => owner.destroy());
  const bytes = [...files.values()].reduce((sum, file) => sum + file.byteLength, 0) / cloud.count;
  return { decibels: psnr(expected, drawn, { channels: 4 }), bytes };
}

test('a scene streamed from coded pages is as near to the whole one as its steps are fine', async () => {
  const cloud = withHarmonics(pebbles(6_000), 2);
  const [usual, fine] = [await closenessOf(cloud, DEFAULT_STEPS), await closenessOf(cloud, FINE)];
  console.log(
    [usual, fine]
      .map(({ decibels, bytes }) => `${decibels.toFixed(1)} dB, ${bytes.toFixed(1)} bytes a splat`)
      .join('; '),
  );
  assert.ok(usual.decibels > 38 && usual.bytes < 30, 'the usual steps');
  assert.ok(fine.decibels > 55 && fine.decibels > usual.decibels + 8, 'fine steps');
});

test('small splats beside large ones keep their size with the smallest steps', async () => {
  const random = randomSource(4);
  const even = pebbles(3_000);
  const cloud = { ...even, scales: even.scales.slice() };
  for (let i = 0; i < cloud.count; i++) {
    const smaller = 2 ** (-12 * random());
    for (let k = 0; k < 3; k++) cloud.scales[3 * i + k] *= smaller;
  }
  const tree = buildDetailTree(cloud, { geometry: 'quantized' });
  const decoded = await decodedLevel(tree, FINE, 0);
  const sizesOf = ({ scales }: GaussianCloud): Float64Array =>
    Float64Array.from({ length: scales.length / 3 }, (_, i) =>
      Math.log2(Math.max(scales[3 * i], scales[3 * i + 1], scales[3 * i + 2])),
    ).sort();
  const [found, expected] = [sizesOf(decoded), sizesOf(cloud)];
  assert.equal(found.length, expected.length);
  const worst = found.reduce((max, size, k) => Math.max(max, Math.abs(size - expected[k])), 0);
  assert.ok(worst < 0.1, `a size is off by ${worst} octaves`);
});

test('what is no coded page is refused, and no more is decompressed than a page can have', async () => {
  const tree = buildDetailTree(withHarmonics(pebbles(1_500), 1), { geometry: 'quantized' });
  const coding = codingFor(DEFAULT_STEPS, tree);
  const [page] = cutPages(tree);
  const whole = new PageEncoder(tree, coding, { deflate }).encode(page);
  const file = { chunks: page.chunks, upper: page.upper, shDegree: 1, coding } as const;
  const refused = async (bytes: Uint8Array, codes: RegExp): Promise<void> => {
    await assert.rejects(decodePage('page', new Uint8Array(bytes), file), (error) => {
      assert.ok(error instanceof GaussianSplatError, String(error));
      assert.match(error.code, codes);
      return true;
    });
  };
  await decodePage('page', whole, file);
  await refused(new Uint8Array(0), /^decode\/(corrupt|truncated)$/);
  await refused(whole.subarray(0, whole.length / 2), /^decode\/(corrupt|truncated)$/);
  await refused(deflateRawSync(new Uint8Array(100)), /^decode\/truncated$/);
  await refused(deflateRawSync(new Uint8Array(2 ** 26)), /^decode\/corrupt$/);
  // Any bytes at all end in words of a page or in an error of this kind.
  for (let k = 0; k < 60; k++) {
    const broken = whole.slice();
    broken[(k * 977) % broken.length] ^= 1 << (k % 8);
    await decodePage('page', broken, file).catch((error: unknown) => assert.ok(error instanceof GaussianSplatError));
  }
});

test('a manifest says how its files are coded', () => {
  const tree = buildDetailTree(pebbles(600), { geometry: 'quantized' });
  const manifest = JSON.parse(
    JSON.stringify(manifestOf(tree, cutPages(tree), String, codingFor(DEFAULT_STEPS, tree))),
  ) as object;
  assert.equal(checkManifest(manifest, 'detail.json').version, 4);
  const { coding } = manifest as { coding: object };
  for (const wrong of [
    { ...manifest, coding: undefined },
    { ...manifest, version: 2 },
    { ...manifest, shPrecision: 'float16' },
    { ...manifest, coding: { ...coding, opacity: 3 } },
    { ...manifest, coding: { ...coding, directions: 7.5 } },
    { ...manifest, coding: { ...coding, scale: 255 } },
    { ...manifest, coding: { ...coding, color: null } },
  ]) {
    assert.throws(() => checkManifest(wrong, 'detail.json'), { code: /^decode\// });
  }
  assert.equal(constants.CULL_GROUP, 256, 'counts of splats are a byte');
});
