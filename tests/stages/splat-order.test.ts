/** The order that a worker finds for the WebGL renderer, against a plain sort. SECURITY.md: "An oversized scene affects only itself". */
import assert from 'node:assert/strict';
import { test } from 'node:test';
import {
  distanceView,
  isSameImage,
  isSameView,
  orderView,
  positionsIn,
  SplatOrder,
  type OrderView,
} from '@gaussian-splat/renderer/webgl';
import { constants, packWithDetail } from '@gaussian-splat/renderer/tools';
import { cameraAt, room } from '../support/scenes.js';

const CHUNK = constants.CULL_GROUP;

/** Ascending depth as float32, equal ones by number. */
function plainOrder(positions: Float32Array, { axis: [x, y, z], offset, near, far }: OrderView): number[] {
  const depths = Array.from({ length: positions.length / 3 }, (_, i) => {
    const depth = x * positions[3 * i] + y * positions[3 * i + 1] + z * positions[3 * i + 2] + offset;
    return { i, depth, key: Math.fround(depth) };
  });
  return depths
    .filter(({ depth }) => depth >= near && depth <= far)
    .sort((a, b) => a.key - b.key || a.i - b.i)
    .map(({ i }) => i);
}

function sorted(positions: Float32Array, view: OrderView): number[] {
  const order = new Uint32Array(positions.length / 3 + 5).fill(7);
  return [...order.subarray(0, new SplatOrder(positions).sort(view, order))];
}

const camera = cameraAt([0.3, -1, -3], [0, 0, 1]);
/** Coordinates with few different values, so that depths repeat; some of them are no numbers. */
const hostile = Float32Array.from({ length: 3 * 5000 }, (_, i) =>
  i % 997 === 0 ? [NaN, Infinity, -Infinity][i % 3] : Math.round(40 * Math.sin(i * i)) / 10,
);
const random = Float32Array.from({ length: 3 * 20_000 }, (_, i) => 5 * Math.sin(12.9898 * i * (i + 1)));

test('as a plain sort has it', () => {
  for (const positions of [random, hostile, new Float32Array(0), Float32Array.of(0, 0, 0)])
    for (const origin of [[0, 0, 0] as const, [1e6, -2e5, 3e5] as const]) {
      const moved = { ...camera, far: 6 };
      const view = orderView({ ...moved, worldToCamera: movedBy(moved.worldToCamera, origin) }, origin);
      assert.deepEqual(sorted(positions, view), plainOrder(positions, view));
    }
});

test('several scenes are in one order, each with its own view', () => {
  const [a, b] = [random.slice(0, 3 * 500), random.slice(3 * 500, 3 * 900)];
  const first = 512;
  const positions = new Float32Array(3 * (first + b.length / 3)).fill(NaN);
  positions.set(a);
  const offset = [2, 0, -1] as const;
  positions.set(
    b.map((value, i) => value + offset[i % 3]),
    3 * first,
  );
  const moved = { ...camera, worldToCamera: movedBy(camera.worldToCamera, offset) };
  const views = [orderView(camera, [0, 0, 0]), { ...orderView(moved, [0, 0, 0]), first }];
  const target = new Uint32Array(positions.length / 3);
  const found = target.subarray(0, new SplatOrder(positions).sort(views, target));
  const depthOf = (i: number): number => {
    const [p, k] = i < first ? [a, i] : [b, i - first];
    const { axis, offset: start } = views[0];
    return axis.reduce((sum, value, c) => sum + value * p[3 * k + c], start);
  };
  assert.ok(found.some((i) => i < first) && found.some((i) => i >= first));
  const visible = [...a.keys()].slice(0, 500).concat([...b.keys()].slice(0, 400).map((k) => first + k));
  assert.equal(found.length, visible.filter((i) => depthOf(i) >= camera.near && depthOf(i) <= camera.far).length);
  for (let k = 1; k < found.length; k++) assert.ok(depthOf(found[k]) - depthOf(found[k - 1]) > -1e-5, `rank ${k}`);
});

test('of levels of detail, exactly one chunk is listed for each part of the scene', () => {
  const { cloud } = room();
  const packed = packWithDetail(cloud);
  const details = packed.details!;
  const leaves = Math.ceil(packed.leafCount! / CHUNK);
  const chunks = packed.count / CHUNK;
  const splats = new SplatOrder(positionsIn(packed.geometry));
  splats.details = details;
  const far = cameraAt([0.3, -1, -40], [0, 0, 0]);
  const counts = [0, 0.5, 2, 8, 64].map((allowed) => {
    const levels = { eye: [0.3, -1, -40] as const, focal: far.fx, nearest: far.near, isParallel: false, allowed };
    const target = new Uint32Array(packed.count);
    const view = { ...orderView(far, packed.origin), near: 1e-3, far: 1e6, levels };
    const listed = target.subarray(0, splats.sort(view, target));
    const drawnChunks = new Set(listed.map((i) => Math.floor(i / CHUNK)));
    for (let leaf = 0; leaf < leaves; leaf++) {
      let drawn = 0;
      for (let [chunk, start, size] = [leaf, 0, leaves]; start < chunks;) {
        if (drawnChunks.has(start + chunk)) drawn++;
        [start, chunk, size] = [start + size, chunk >> 2, size === 1 ? 0 : Math.ceil(size / 4)];
        if (size === 0) break;
      }
      assert.equal(drawn, 1, `leaf ${leaf} at ${allowed} px`);
    }
    return drawnChunks.size;
  });
  assert.equal(counts[0], leaves, 'without an error the finest level');
  assert.ok(counts.slice(1).every((count, k) => count <= counts[k]) && counts[4] < counts[0] / 4, counts.join());
});

test('the same again with the same view, another with another', () => {
  const order = new SplatOrder(random);
  const target = new Uint32Array(random.length / 3);
  const a = orderView(camera, [0, 0, 0]);
  const b = orderView(cameraAt([3, 0, 0], [0, 0, 0]), [0, 0, 0]);
  assert.ok(isSameView(a, orderView(camera, [0, 0, 0])) && !isSameView(a, b));
  const first = target.slice(0, order.sort(a, target));
  order.sort(b, target);
  assert.notDeepEqual(target.slice(0, first.length), first);
  assert.deepEqual(target.slice(0, order.sort(a, target)), first);
});

/** The matrix of the same view of a world that has been moved. */
function movedBy(m: ArrayLike<number>, [x, y, z]: readonly [number, number, number]): number[] {
  return Array.from(m, (value, i) =>
    i < 12 && i % 4 === 3 ? value - (m[i - 3] * x + m[i - 2] * y + m[i - 1] * z) : value,
  );
}

test('the sum of the areas on screen says how often the image is covered', () => {
  const positions = new Float32Array(3 * 3_000);
  const areas = new Float32Array(3_000).fill(100);
  const splats = new SplatOrder(positions, areas);
  const order = new Uint32Array(4_000);
  splats.sort(orderView(camera, [0, 0, 0]), order);
  assert.equal(splats.covered, 3_000, 'each covers all of it');
  // The value from 1,000 times as far is a millionth, and beside the image it is 0.
  const far = cameraAt([300, -1000, -3000], [0, 0, 1]);
  splats.sort(orderView(far, [0, 0, 0]), order);
  assert.ok(splats.covered < 1, `${splats.covered} from afar`);
  areas.fill(0.5);
  const beside = new SplatOrder(
    positions.map((_, i) => (i % 3 === 0 ? 40 : 0)),
    areas,
  );
  beside.sort(orderView(camera, [0, 0, 0]), order);
  assert.ok(beside.covered < 300, `${beside.covered} beside the image`);
});

test('an order by distance is covered like one by depth, in whichever direction the camera looks', () => {
  const areas = new Float32Array(3_000).fill(100);
  const splats = new SplatOrder(new Float32Array(3 * 3_000), areas);
  const order = new Uint32Array(4_000);
  splats.sort(distanceView(camera, [0, 0, 0]), order);
  assert.equal(splats.covered, 3_000);
  const away = cameraAt([0.3, -1, -3], [0.3, -1, -9]);
  assert.equal(splats.sort(distanceView(away, [0, 0, 0]), order), 3_000, 'listed');
  assert.equal(splats.covered, 0, 'behind the camera');
});

test('a view that zooms or moves aside needs the coverage again', () => {
  const at = (x: number): OrderView => orderView(cameraAt([x, 0, -3], [x, 0, 0]), [0, 0, 0]);
  const zoomed = { ...at(0), shareOfArea: 2 * at(0).shareOfArea };
  assert.ok(isSameImage(at(0), at(0)));
  for (const view of [at(40), zoomed]) assert.ok(isSameView(at(0), view) && !isSameImage(at(0), view));
});
