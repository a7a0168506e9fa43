/**
 * Floors: found in splats, stored, walked on, and bounded in work.
 * SECURITY.md: "The size of a file bounds its cost".
 */
import assert from 'node:assert/strict';
import { spawnSync } from 'node:child_process';
import { mkdtempSync, readFileSync, rmSync } from 'node:fs';
import { tmpdir } from 'node:os';
import { join } from 'node:path';
import { test } from 'node:test';
import { gunzipSync, gzipSync } from 'node:zlib';
import { readScene } from '@gaussian-splat/formats';
import {
  decodeFloorMap,
  encodeFloorMap,
  floorAt,
  floorOf,
  makeFloorMap,
  stepOn,
  wayTo,
  type FloorOptions,
  type FloorMap,
} from '@gaussian-splat/formats/floor';
import { capturedHouse, floorsOfHouse, isBlockedInHouse, type CaptureOptions } from '../support/captured-house.js';
import { needsSharedData, sharedFile } from '../support/data.js';
import { onlyInLab } from '../support/extent.js';
import { cloudOf, FRAME, isOutside, random, ROOM, wander } from './support/floor-room.js';

test('a room of boxes: the floor, the gallery above it and the stairs between are one map', async () => {
  const map = makeFloorMap(cloudOf(ROOM), { frame: FRAME, near: [0, 1.5, 2] });
  const ground = floorAt(map, 0, 2, 0);
  assert.ok(ground !== undefined && Math.abs(ground) < 0.02, `the floor is at ${ground} m`);
  const gallery = floorAt(map, 0, -3.7, 2.2);
  assert.ok(gallery !== undefined && Math.abs(gallery - 2.2) < 0.03, `the gallery is at ${gallery} m`);
  assert.ok(floorAt(map, 0, -3.7, 0) !== undefined, 'there is a floor below the gallery');
  assert.equal(floorAt(map, 0, -2.5, 0), undefined, 'a walker never stands in the table');
  assert.equal(floorAt(map, 3.95, 2, 0), undefined, 'a walker never stands in the wall');
  assert.equal(wander(map, isOutside).out, 0);
  const up = await wayTo(map, [0, ground!, 2], [0, gallery!, -3.7]);
  assert.ok(up.length > 40, `the way up goes through the door and over the stairs: ${up.length} cells`);
  assert.ok(
    up.every((place, i) => i === 0 || Math.abs(place[1] - up[i - 1][1]) <= map.step),
    'no step is higher than a person takes',
  );
});

test('the spoilt room: jitter, faint splats and floaters let no one out', () => {
  const map = makeFloorMap(cloudOf(ROOM, random(3)), { frame: FRAME, near: [0, 1.5, 2], voxel: 0.1 });
  assert.ok(map.area > 40, `${map.area} m²`);
  assert.equal(wander(map, isOutside).out, 0);
});

test('a clump of floaters blocks no one, a lamp of three times its size does', () => {
  const hanging = (x: number, half: number): (typeof ROOM)[number] => ({
    min: [x - half, 1 - half, -half],
    max: [x + half, 1 + half, half],
  });
  const cloud = cloudOf([{ min: [-2, -0.2, -2], max: [2, 0, 2] }, hanging(-1, 0.06), hanging(1, 0.18)]);
  const scales = cloud.scales.map((scale, k) => (cloud.positions[3 * Math.floor(k / 3) + 1] < -0.5 ? 0.02 : scale));
  const map = makeFloorMap({ ...cloud, scales }, { frame: FRAME, near: [0, 1.5, 1] });
  assert.deepEqual([floorAt(map, -1, 0, 0) === undefined, floorAt(map, 1, 0, 0) === undefined], [false, true]);
});

/** How phones capture: 2 cm of noise, opacities of 0.05 to 1, 15 % of the splats missing. */
const CAPTURE = { noise: 0.02, faintest: 0.05, missing: 0.15 } as const;
const CAPTURES: Readonly<Record<string, CaptureOptions>> = {
  clean: {},
  'clean, with a garden': { hasGarden: true },
  captured: CAPTURE,
  '0.5 % floaters': { ...CAPTURE, floaters: 0.005 },
  '2 % floaters': { ...CAPTURE, floaters: 0.02 },
  haze: { ...CAPTURE, haze: 600 },
  'haze and floaters': { ...CAPTURE, haze: 600, floaters: 0.02 },
  '1 % far': { ...CAPTURE, far: 0.01 },
  '3 % far': { ...CAPTURE, far: 0.03 },
  '15 % far': { ...CAPTURE, far: 0.15 },
  'all of it, tilted': { ...CAPTURE, hasGarden: true, floaters: 0.005, haze: 150, ghosts: 0.3, far: 0.05, tilt: 0.26 },
  'a box, a chair and a table in a row': { ...CAPTURE, hasChain: true, floaters: 0.005, haze: 150, far: 0.01 },
};
/** Names of the captures of `npm test`; the laboratory has all. */
const EACH_TIME = ['a box, a chair and a table in a row'];

/** Returns the rows of a frame whose up axis is tilted about z, radians. */
const tiltedFrame = (tilt: number): FloorOptions['frame'] => [
  [Math.cos(tilt), Math.sin(tilt), 0],
  [-Math.sin(tilt), Math.cos(tilt), 0],
  [0, 0, 1],
];

/** Square meters of the floor of the house that a map has, its gallery, what is no floor; heights' errors in meters, sorted. */
function houseIn(map: FloorMap): { area: number; gallery: number; wrong: number; errors: number[] } {
  const found = { area: 0, gallery: 0, wrong: 0, errors: [] as number[] };
  const cell = map.cell ** 2;
  for (const layer of map.layers)
    layer.forEach((height, i) => {
      if (Number.isNaN(height)) return;
      const x = map.corner[0] + ((i % map.width) + 0.5) * map.cell;
      const z = map.corner[1] + (Math.floor(i / map.width) + 0.5) * map.cell;
      const off = (at: number, to: number): number =>
        Math.min(...floorsOfHouse(at, to).map((floor) => Math.abs(floor - height)));
      const error = off(x, z);
      // The edge of a floor may be off by one and a half cells.
      const around = [-1, 0, 1].flatMap((i) =>
        [-1, 0, 1].map((k) => off(x + 1.5 * i * map.cell, z + 1.5 * k * map.cell)),
      );
      if (Math.min(...around) > 0.2 || isBlockedInHouse([x, height, z], 0.1)) found.wrong += cell;
      else if (error < Infinity) found.errors.push(error);
      found.area += cell;
      if (height > 2.3) found.gallery += cell;
    });
  found.errors.sort((a, b) => a - b);
  return found;
}

/** Square meters on which a body of 20 cm fits, on all floors of the house. */
function areaOfHouse({ hasChain }: CaptureOptions): number {
  let area = 0;
  for (let x = -2.975; x < 9; x += 0.05)
    for (let z = -2.475; z < 2.5; z += 0.05)
      for (const y of floorsOfHouse(x, z)) if (!isBlockedInHouse([x, y, z], 0.2, hasChain)) area += 0.05 ** 2;
  return area;
}

for (const [name, options] of Object.entries(CAPTURES))
  test(`a house, ${name}: all of its floor and nothing else`, { skip: !EACH_TIME.includes(name) && onlyInLab }, () => {
    const { tilt = 0 } = options;
    const map = makeFloorMap(capturedHouse(options), { frame: tiltedFrame(tilt), near: [2, 1.6, -1.5], height: 1.7 });
    const { area, gallery, wrong, errors } = houseIn(map);
    const whole = areaOfHouse(options);
    const [half, high] = [0.5, 0.95].map((share) => 100 * errors[Math.floor(share * errors.length)]);
    console.log(
      `${name}: ${area.toFixed(1)} of ${whole.toFixed(1)} m², gallery ${gallery.toFixed(1)}, no floor ${wrong.toFixed(2)}; heights off by ${half.toFixed(1)} cm, 95 % within ${high.toFixed(1)} cm`,
    );
    assert.ok(Math.abs(area / whole - 1) < 0.05, `${area} of ${whole} m²`);
    assert.ok(gallery > 3.8, `${gallery} m² of the gallery`);
    assert.ok(wrong < 0.25, `${wrong} m² are no floor`);
    assert.ok(half < 1, `heights are off by ${half} cm`);
    assert.ok(high < 2, `95 % of the heights are within ${high} cm`);
    if (options.hasChain) assertStopped(map);
  });

/** Asserts that furniture in a row is not climbed, and that the edge of the hole stops the body. */
function assertStopped(map: FloorMap): void {
  for (const [x, z] of [
    [0, 0],
    [0.8, 0],
    [1.2, 0],
  ] as const)
    // prettier-ignore
    for (const near of [0.25, 0.5, 0.75]) assert.equal(floorAt(map, x, z, near), undefined, `at ${x}, ${z}`);
  const stopped = stepOn(map, [-1.8, 0, -0.2], 0, 1.6);
  assert.ok(stopped[2] < 0.95, `walked to z = ${stopped[2]}, into the hole`);
  assert.equal(floorAt(map, -1.8, 1.4, 0), undefined);
}

test('a path does not leave one side of the map to enter it at the other', async () => {
  // Two arms at the left and the right edge, which meet only at the far end.
  const [width, depth, cell] = [10, 12, 0.05];
  const layer = Float32Array.from({ length: width * depth }, (_, i) => {
    const [x, z] = [i % width, Math.floor(i / width)];
    return x < 2 || x >= width - 2 || z === depth - 1 ? 0 : NaN;
  });
  const map: FloorMap = {
    ...{ cell, corner: [0, 0], width, depth, layers: [layer], step: 0.3, start: [0.025, 0, 0.025], area: 1 },
  };
  for (const [from, to] of [
    [0.475, 0.025],
    [0.025, 0.475],
  ]) {
    const way = await wayTo(map, [from, 0, 0.125], [to, 0, 0.125]);
    assert.ok(way.length >= 24, `${way.length} cells, 24 lead around`);
    way.reduce(
      (before, place) => {
        assert.ok(Math.hypot(place[0] - before[0], place[2] - before[2]) < 1.5 * cell, `${before} to ${place}`);
        return place;
      },
      [from, 0, 0.125] as readonly number[],
    );
  }
});

test('a path over a floor of 1,000 m² is found in the time of a few frames', async () => {
  const side = 640;
  const map: FloorMap = {
    ...{ cell: 0.05, corner: [0, 0], width: side, depth: side, step: 0.3, start: [0, 0, 0], area: 1024 },
    layers: [new Float32Array(side * side)],
  };
  const before = process.cpuUsage();
  assert.equal((await wayTo(map, [0, 0, 0], [31.99, 0, 31.99])).length, side - 1);
  const { user, system } = process.cpuUsage(before);
  assert.ok(user + system < 0.5e6, `${(user + system) / 1e6} s of CPU`);
  assert.deepEqual(await wayTo(map, [1.01, 0, 1.01], [1.02, 0, 1.03]), [[1.02, 0, 1.03]], 'within a cell');
});

/** Counts the tasks of work, with its longest by the places that a proxy of the layers saw read. */
async function tasksOf(
  map: FloorMap,
  work: (map: FloorMap) => Promise<unknown>,
): Promise<{ max: number; all: number }> {
  let [max, all, own] = [0, 0, 0];
  const counting = map.layers.map(
    (layer) =>
      new Proxy(layer, {
        get(target, key) {
          own++;
          return Reflect.get(target, key, target) as unknown;
        },
      }),
  );
  let isOver = false;
  const turn = (): void => {
    [max, all, own] = [Math.max(max, own), all + own, 0];
    if (!isOver) setImmediate(turn);
  };
  turn();
  await work({ ...map, layers: counting });
  isOver = true;
  turn();
  return { max, all };
}

test('a search over many floors is divided into short tasks, and ends', async () => {
  const [side, floors] = [30, 256];
  const map: FloorMap = {
    ...{ cell: 0.05, corner: [0, 0], width: side, depth: side, step: 1e3, start: [0, 0, 0], area: 1 },
    layers: Array.from({ length: floors }, (_, k) => new Float32Array(side * side).fill(k)),
  };
  const { max, all } = await tasksOf(map, (counted) => wayTo(counted, [0, 0, 0], [1.49, 0, 1.49]));
  assert.ok(all > 1e6 && max < 2e6, `${all} heights are compared, ${max} in one task`);
  const aborted = AbortSignal.abort(new Error('another motion'));
  await assert.rejects(wayTo(map, [0, 0, 0], [1.49, 0, 1.49], aborted), /another motion/);
});

test('a step over cells of a millimeter is bounded', async () => {
  const map: FloorMap = {
    ...{ cell: 1e-3, corner: [0, 0], width: 2000, depth: 2, step: 1, start: [0, 0, 0], area: 1 },
    layers: [new Float32Array(4000)],
  };
  const { all } = await tasksOf(map, async (counted) => stepOn(counted, [0, 0, 0], 1e12, 0));
  assert.ok(all < 20_000, `${all} heights`);
});

let emptyMap: FloorMap | undefined;
/** The room without stairs and gallery. */
const emptyRoom = (): FloorMap =>
  (emptyMap ??= makeFloorMap(cloudOf(ROOM.slice(0, 5)), { frame: FRAME, near: [0, 1.5, 2], voxel: 0.1 }));

test('a walk map is stored in centimeters and read again', () => {
  const map = emptyRoom();
  const file = encodeFloorMap(map);
  assert.ok(file.length < 3000, `${file.length} bytes`);
  const { layers, ...rest } = decodeFloorMap(file);
  const { layers: before, ...same } = map;
  assert.deepEqual({ ...rest, heightUnit: undefined }, { ...same, heightUnit: undefined });
  layers.forEach((layer, k) =>
    layer.forEach((height, i) => {
      assert.equal(Number.isNaN(height), Number.isNaN(before[k][i]));
      if (!Number.isNaN(height)) assert.ok(Math.abs(height - before[k][i]) <= 0.0051);
    }),
  );
});

test('damaged walk maps are refused by name', () => {
  const file = encodeFloorMap(emptyRoom());
  const damaged = [new Uint8Array(), new Uint8Array(3), file.subarray(0, 40), new Uint8Array(100).fill(31)];
  for (let i = 0; i < 200; i++)
    damaged.push(file.map((byte, at) => (at === (i * 37) % file.length ? byte ^ 0x55 : byte)));
  for (const bytes of damaged)
    try {
      decodeFloorMap(bytes);
    } catch (error) {
      assert.equal((error as { code?: string }).code, 'decode/corrupt', String(error));
    }
  assert.throws(() => decodeFloorMap(file.subarray(0, 40)), { code: 'decode/corrupt' });
});

test('walk maps whose first line claims more than there is are refused by name', () => {
  const map = { cell: 0.1, corner: [0, 0], width: 1, depth: 1, step: 0.3, start: [0, 0, 0], area: 1 } as const;
  const whole = gunzipSync(encodeFloorMap({ ...map, layers: [Float32Array.of(0)] }));
  const head = JSON.parse(new TextDecoder().decode(whole.subarray(0, whole.indexOf(10)))) as object;
  for (const claim of [
    { corner: 5 },
    { corner: [0, 0, 0], start: [0, 0] },
    { start: 'abc' },
    { width: 0, depth: 0, layers: 10_000_000 },
    { cell: 1e-300 },
    { cell: 1e9 },
    { step: 1e300 },
    { format: { toString: 1 } },
  ]) {
    const file = gzipSync(new TextEncoder().encode(`${JSON.stringify({ ...head, ...claim })}\n`));
    assert.throws(() => decodeFloorMap(file), { code: 'decode/corrupt' }, JSON.stringify(claim));
  }
});

test('a first line of lists within lists is refused as JSON', () => {
  for (const depth of [300, 200_000]) {
    const line = `{"format":"gaussian-splat-walk-map","version":1,"cell":${'['.repeat(depth)}${']'.repeat(depth)}}\n`;
    assert.throws(() => decodeFloorMap(gzipSync(new TextEncoder().encode(line))), { code: 'decode/corrupt' });
  }
});

test('a walk map costs what it weighs', () => {
  const map = { cell: 0.1, corner: [0, 0], width: 4096, depth: 4000, step: 0.3, start: [0, 0, 0], area: 1 } as const;
  const file = encodeFloorMap({ ...map, layers: [new Float32Array(4096 * 4000)] });
  assert.ok(file.length < 100_000, `${file.length} bytes`);
  assert.throws(() => decodeFloorMap(file), { code: 'out-of-memory/budget' });
  const small = { ...map, width: 400 };
  assert.throws(
    () => decodeFloorMap(encodeFloorMap({ ...small, layers: [new Float32Array(1.6e6)] }), 'a', { maxBytes: 1e6 }),
    {
      code: 'out-of-memory/budget',
    },
  );
});

test('what is no room has no floor, and no exception', async () => {
  const single = cloudOf([{ min: [0, 0, 0], max: [0.1, 0.1, 0.1] }]);
  const map = makeFloorMap(single, { frame: FRAME });
  assert.equal(map.area < 4, true);
  assert.equal(floorAt(map, 100, 100, 0), undefined);
  assert.deepEqual(await wayTo(map, [0, 0, 0], [50, 0, 50]), []);
  assert.throws(() => makeFloorMap(single, { frame: FRAME, metersPerUnit: 0 }), { code: 'argument/value' });
});

/** Plates above each other, every other voxel of 4 m, in 64 columns: each height is compared with all of its column. */
function plates(): Parameters<typeof floorOf> {
  const size = [8, 2 ** 16, 8] as const;
  const solid = Uint8Array.from({ length: 64 * size[1] }, (_, at) => (Math.floor(at / 8) % size[1]) % 2);
  return [{ corner: [0, 0, 0], size, voxel: 4 }, solid];
}
const tooMuch = { code: 'out-of-memory/budget' };

test('the search for a floor ends after the seconds of the page', () => {
  const [grid, solid] = plates();
  const before = process.cpuUsage();
  assert.throws(() => floorOf(grid, solid, { limits: { maxSeconds: 0.2 } }), tooMuch);
  const large = cloudOf(ROOM);
  large.scales.fill(50);
  assert.throws(() => makeFloorMap(large, { frame: FRAME, limits: { maxSeconds: 0.2 } }), tooMuch);
  const { user, system } = process.cpuUsage(before);
  assert.ok(user + system < 8e6, `${(user + system) / 1e6} s of CPU`);
});

test('without a limit it ends after a number of steps', { skip: onlyInLab }, () => {
  const [grid, solid] = plates();
  assert.throws(() => floorOf(grid, solid), tooMuch);
});

test('a grid of more columns than a floor may have is refused before they are searched', () => {
  const size = [2049, 4, 2048] as const;
  const solid = new Uint8Array(size[0] * size[1] * size[2]);
  assert.throws(() => floorOf({ corner: [0, 0, 0], size, voxel: 0.05 }, solid), tooMuch);
});

test(
  'a captured ground of 6 by 6 m: no step leaves it, over its edge or into the air',
  { skip: onlyInLab || needsSharedData },
  async () => {
    const cloud = await readScene(sharedFile('formats/playbot3.ply'), { name: 'playbot3.ply' });
    const east = Float32Array.from({ length: cloud.count }, (_, i) => cloud.positions[3 * i]).sort();
    const metersPerUnit = 6 / (east[Math.floor(0.99 * cloud.count)] - east[Math.floor(0.01 * cloud.count)]);
    const map = makeFloorMap(cloud, { frame: FRAME, metersPerUnit });
    console.log(`${map.area.toFixed(1)} m²`);
    assert.ok(map.area > 25 && map.area < 45, `${map.area} m²`);
    // Heights of opaque splats, by columns of 20 cm.
    const side = 0.2;
    const columns = new Map<string, number[]>();
    const column = (x: number, z: number): string => `${Math.floor(x / side)} ${Math.floor(z / side)}`;
    for (let i = 0; i < cloud.count; i++) {
      if (cloud.opacities[i] < 0.3) continue;
      const [x, y, z] = [0, 1, 2].map((k) => (k === 0 ? 1 : -1) * metersPerUnit * (cloud.positions[3 * i + k] + cloud.origin[k])); // prettier-ignore
      const key = column(x, z);
      columns.set(key, [...(columns.get(key) ?? []), y]);
    }
    const isOff = ([x, y, z]: readonly [number, number, number]): boolean =>
      ![-1, 0, 1].some((a) =>
        [-1, 0, 1].some((b) =>
          columns.get(column(x + a * side, z + b * side))?.some((height) => Math.abs(height - y) < 0.3),
        ),
      );
    assert.equal(wander(map, isOff).out, 0);
  },
);

test(
  'statues have no floor to walk on, a skull in haze but its top',
  { skip: onlyInLab || needsSharedData },
  async () => {
    // The top of the skull, 6 m wide at this unit, is nearly level: its haze and bone count as a faint floor.
    for (const [name, max] of [
      ['scenes/st-peter.sog', 4],
      ['scenes/angel.sog', 4],
      ['scenes/skull.ply', 16],
    ] as const) {
      const cloud = await readScene(sharedFile(name), { name });
      const { area } = makeFloorMap(cloud, { frame: FRAME });
      console.log(`${name}: ${area.toFixed(1)} m²`);
      assert.ok(area < max, `${name}: ${area} m²`);
    }
  },
);

test('gaussian-splat floor writes the map, and names what it misses', () => {
  const folder = mkdtempSync(join(tmpdir(), 'floor-'));
  const scene = 'demo/scenes/studio/apartment.spz';
  try {
    const out = join(folder, 'apartment.floor');
    const run = (...args: string[]): ReturnType<typeof spawnSync> =>
      spawnSync(process.execPath, ['packages/cli/bin/gaussian-splat.mjs', 'floor', scene, ...args], {
        encoding: 'utf8',
      });
    const { stdout, stderr, status } = run('--out', out, '--cell', '20cm', '--near', '2.9,1.6,2.7');
    assert.equal(status, 0, String(stderr));
    const [, area] = /([\d.]+) m² of floor/.exec(String(stdout)) ?? [];
    assert.ok(Math.abs(decodeFloorMap(readFileSync(out)).area - Number(area)) < 0.1, String(stdout));
    assert.ok(Number(area) > 14 && Number(area) < 32, String(stdout));
    const wrong = run('--out', out, '--unit', '5');
    assert.equal(wrong.status, 2);
    assert.match(String(wrong.stderr), /--unit: expected a length/);
  } finally {
    rmSync(folder, { recursive: true, force: true });
  }
});
