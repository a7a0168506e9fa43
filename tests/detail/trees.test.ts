/** Trees of levels as pages: runs nest, every place is covered once while nodes arrive, and the finest nodes are the scene. */
import assert from 'node:assert/strict';
import { after, test } from 'node:test';
import { shCoefficientCount, type Camera, type GaussianCloud, type ShDegree } from '@gaussian-splat/core';
import { StreamedGaussians, type StreamedScene } from '@gaussian-splat/renderer';
import { NodePacker, packNodes, treeSource, type NodePage, type RunError } from '@gaussian-splat/renderer/tools';
import { constants, DETAIL_NUMBERS, DETAIL_PLACES, SLOT_CHUNKS } from '@gaussian-splat/renderer/stages';
import { shareDrawn, type DetailView } from '../support/detail-twin.js';
import { drawUntilCalm } from '../support/draw-until-calm.js';
import { someOf } from '../support/extent.js';
import { withHostileSplats } from '../support/hostile.js';
import { pick } from '../support/lod-folder.js';
import { anyDevice, endNodeDevice } from '../support/node-device.js';
import { readRows } from '../support/read-rows.js';
import { seededRandom } from '../support/random.js';
import { Renderer } from '../support/renderer.js';
import { cameraAt } from '../support/scenes.js';
import { pebbles } from '../support/scenes/pebbles.js';

after(endNodeDevice);

interface Box {
  readonly cloud: GaussianCloud | undefined;
  readonly volume: readonly number[];
  readonly children: readonly Box[];
  readonly isAdded: boolean;
}

/** A quadtree of boxes over x and z. Some of its nodes have no splats, some are drawn in addition to their children. */
function quadtree(cloud: GaussianCloud, levels: number, kind: (level: number) => 'replaced' | 'added' | 'empty'): Box {
  const { positions, count } = cloud;
  const boxAt = (own: readonly number[], level: number, [x, z, half]: readonly number[]): Box => {
    const isFinest = level === levels - 1;
    const quarter = (i: number): number => (positions[3 * i] > x ? 1 : 0) + (positions[3 * i + 2] > z ? 2 : 0);
    const is = isFinest ? 'replaced' : kind(level);
    // Splats that are added are not below.
    const [taken, left] =
      is === 'added' ? [own.filter((_, k) => k % 8 === 0), own.filter((_, k) => k % 8 > 0)] : [own, own];
    const step = is === 'added' ? 1 : 4 ** (levels - 1 - level);
    const children = isFinest
      ? []
      : [0, 1, 2, 3].map((k) => {
          const center = [x + ((k & 1) - 0.5) * half, z + ((k >> 1) - 0.5) * half, half / 2];
          return boxAt(
            left.filter((i) => quarter(i) === k),
            level + 1,
            center,
          );
        });
    return {
      ...{
        children: children.filter(({ cloud: one, children: below }) => one || below.length > 0),
        isAdded: is === 'added',
      },
      cloud:
        is === 'empty' || own.length === 0
          ? undefined
          : pick(
              cloud,
              taken.filter((_, k) => k % step === 0),
              Math.sqrt(step),
            ),
      volume: [x, 0, z, half, 0, 0, 0, 1.5, 0, 0, 0, half, Math.hypot(half, half, 1.5)],
    };
  };
  return boxAt(
    Array.from({ length: count }, (_, i) => i),
    0,
    [0, 0, 7.5],
  );
}

const OPTIONS = { threads: 'serial', sort: 'serial' } as const;

const scene: StreamedScene = {
  ...{ shDegree: 1, shPrecision: 'int8', geometry: 'quantized', splats: 0, antialiased: false, origin: [0, 0, 0] },
  bounds: { min: [-7, -1, -7], max: [7, 1, 7], center: [0, 0, 0], radius: 7 },
};
const pageOf = ({ cloud, children, isAdded }: Box, above?: RunError): NodePage =>
  packNodes([{ cloud, volumes: children.map(({ volume }) => volume), isAdded, error: Infinity }], scene, above);

const KINDS = [
  ['tiles that are replaced', () => 'replaced' as const],
  ['tiles above others without splats', (level: number) => (level === 1 ? ('empty' as const) : ('replaced' as const))],
  ['tiles that are added to', (level: number) => (level === 1 ? ('added' as const) : ('replaced' as const))],
] as const;

const rangeOf = (total: number): number[] => Array.from({ length: total }, (_, k) => k);

for (const [name, kind] of KINDS)
  test(`${name}: a run is within the sphere and the error of the run above it, and all splats are in a run`, () => {
    const cloud = pebbles(6_000);
    let leaves = 0;
    const check = (box: Box, above?: RunError): void => {
      const { runs, errors, counts, splats, words } = pageOf(box, above);
      assert.deepEqual(
        [runs.length, errors.length, counts.length],
        rangeOf(3).map(() => box.children.length),
      );
      assert.ok(words.length > 0 && runs.every((chunks) => chunks >= 1));
      if (box.isAdded || box.children.length === 0) leaves += splats;
      else
        assert.equal(
          counts.reduce((sum, count) => sum + count, 0),
          splats,
        );
      box.children.forEach((child, k) => {
        const [x, y, z, radius, error] = errors[k];
        assert.ok(error > 0 && radius > 0);
        if (above) {
          const apart = Math.hypot(x - above[0], y - above[1], z - above[2]);
          assert.ok(apart + radius <= above[3] && error < above[4], `${errors[k].join(' ')} in ${above.join(' ')}`);
        }
        check(child, errors[k]);
      });
    };
    check(quadtree(cloud, 4, kind));
    assert.equal(leaves, cloud.count);
  });

/** Needles, disks, points at one place and unusable splats. The first 300 are equal; the last has no partner in its pair. */
function hostileNode(shDegree: ShDegree): GaussianCloud {
  const random = seededRandom(shDegree + 1);
  const count = 3_001;
  const stride = 3 * shCoefficientCount(shDegree);
  const numbers = (size: number, value: (i: number, k: number) => number): Float32Array =>
    Float32Array.from({ length: size * count }, (_, n) => value(n < 300 * size ? 0 : Math.floor(n / size), n % size));
  const turns = Array.from({ length: count }, () => random.rotation());
  const base = {
    ...{ count, shDegree, antialiased: false, droppedCount: 0, origin: [0.25, 0, 0] as const },
    positions: numbers(3, (i) => (i === 0 ? 0 : 4 * random.normal())),
    scales: numbers(3, (i, k) => (i === 0 ? 0.5 : i % 7 === k ? 0 : random.logUniform(1e-6, 10))),
    rotations: numbers(4, (i, k) => 3 * turns[i][k]),
    opacities: numbers(1, (i) => [0, 1 / 255, 0.0039, 1, random.uniform(0, 1)][i % 5]),
    sh: numbers(stride, (i) => (i % 11 === 0 ? 0 : random.normal() * random.logUniform(1e-7, 100))),
  };
  return withHostileSplats(base).cloud;
}

test('WebAssembly packs, divides and sorts the splats of a node to the same words', async () => {
  const packer = (await NodePacker.open())!;
  const box = (x: number, z: number): number[] => [x, 0, z, 1.5, 0.5, 0, 0, 9, 0, -0.5, 0, 1.5, 10];
  const volumes = [box(-2, -2), undefined, box(2, -2), box(-2, 2), [2, 0, 2, 0, 0, 0, 0, 9, 0, 0, 0, 1, 10]];
  for (const shDegree of [0, 1, 2, 3] as const)
    for (const shPrecision of ['int8', 'float16'] as const)
      for (const node of [
        { volumes, isAdded: false },
        { volumes: [], isAdded: false },
        { volumes, isAdded: true },
        { volumes: volumes.slice(2), isAdded: false, parts: [255, 1, 2_000] },
      ]) {
        const content = { cloud: hostileNode(shDegree), error: Infinity, ...node };
        const own = { ...scene, shDegree, shPrecision };
        const [expected, found] = [undefined, packer].map((one) => packNodes([content], own, undefined, one));
        assert.ok(expected.splats === 3_001);
        assert.deepEqual(found, expected, `degree ${shDegree}, ${shPrecision}`);
      }
});

const viewFrom = (distance: number, angle: number, x = 0): Camera =>
  cameraAt([x + distance * Math.cos(angle), -0.5 * distance, distance * Math.sin(angle)], [x, 0, 0], {
    ...{ width: 48, height: 32, fovXDegrees: 60, near: 0.01 },
  });

for (const [name, kind] of someOf(KINDS, 1))
  test(`${name}: with memory for a part of them, every place is covered exactly once wherever the camera goes`, async () => {
    const device = await anyDevice();
    const root = quadtree(pebbles(24_000), 4, kind);
    const fetched: number[] = [];
    const source = treeSource<Box>(
      { scene, first: pageOf(root), children: root.children, isComplete: false },
      async (box, above) => {
        fetched.push(box.volume[0]);
        return { ...pageOf(box, above), found: [] };
      },
    );
    const memoryBudget = 1_400_000;
    const opened = await StreamedGaussians.openSource(device, source, { memoryBudget, arrivalMs: 0 });
    const renderer = new Renderer(device, OPTIONS);
    const { list } = source;
    let highest = 0;
    const places = [[30, 0.4, 0], [6, 1, 3], [3, 2, -4], [2, 4, 5], [40, 5, 0]]; // prettier-ignore
    for (const [distance, angle, x] of someOf(places, 3)) {
      const camera = viewFrom(distance, angle, x);
      await drawUntilCalm(opened, renderer, camera, 0.25);
      const rows = await readRows(opened);
      /** Rows of the chunks of each page. */
      const rowsOf = new Map<number, Float32Array[]>();
      opened.pagesInSlots.forEach((page, slot) => {
        if (page === undefined) return;
        const own = Array.from({ length: SLOT_CHUNKS }, (_, c) =>
          rows[slot].subarray(DETAIL_NUMBERS * c, DETAIL_NUMBERS * (c + 1)),
        );
        rowsOf.set(page, [...(rowsOf.get(page) ?? []), ...own.filter((row) => row.some((number) => number !== 0))]);
      });
      highest = Math.max(highest, opened.pagesInSlots.filter((page) => page !== undefined).length);
      const view: DetailView = { camera, allowed: 0.25, fade: 0 };
      let paths = 0;
      const visit = (page: number, row: Float32Array, above: number): void => {
        const sum = above + shareDrawn(row, 0, view);
        const [word] = new Uint32Array(row.buffer, row.byteOffset + 4 * DETAIL_PLACES.children, 1);
        const below = rowsOf.get(word & constants.CHILD_PAGE_MASK);
        if (below) return below.forEach((next) => visit(word & constants.CHILD_PAGE_MASK, next, sum));
        paths++;
        assert.ok(Math.abs(sum - 1) < 1e-4, `page ${page}: covered ${sum} times`);
      };
      for (const [page, own] of rowsOf) assert.equal(own.length, list.chunks[page]);
      rowsOf.get(0)!.forEach((row) => visit(0, row, 0));
      assert.ok(paths > 0);
      assert.ok(opened.progress.bytes <= memoryBudget, `${opened.progress.bytes} bytes`);
    }
    console.log(
      `${list.count} pages known, ${fetched.length} fetched, ${highest} slots in use, ${opened.leafCount} splats known`,
    );
    assert.ok(list.count > 5 && fetched.length > 5);
    [renderer, opened].forEach((owner) => owner.destroy());
  });
