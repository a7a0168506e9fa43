import { inverse, type Camera, type Vector3 } from '@gaussian-splat/core';
import { packGaussians } from '@gaussian-splat/renderer';
import {
  constants,
  layouts,
  mortonOrder,
  OcclusionDepthsStage,
  occlusionView,
  writeStruct,
} from '@gaussian-splat/renderer/stages';
import { toCamera } from '../../oracle/projection.js';
import { cloudOf, repeat } from '../../support/clouds.js';
import { check, checkEqual, randomSource, type Bench, type StageCase } from '../../support/gpu.js';
import { cameraAt } from '../../support/scenes.js';
import { cullOnGpu } from './projection.js';

const { TILE, OCCLUSION_BLOCK } = constants;
/** Bits of infinity. */
const OPEN = 0x7f800000;
/** 10 x 7 tiles, the last row and column cut off. */
const SIZE = { width: 155, height: 100 };
const TILES = [Math.ceil(SIZE.width / TILE), Math.ceil(SIZE.height / TILE)] as const;
const BLOCKS = TILES.map((tiles) => Math.ceil(tiles / OCCLUSION_BLOCK));
const COUNT = TILES[0] * TILES[1];
const MARGIN = 1.01;

const toBits = (depths: Float32Array): Uint32Array => new Uint32Array(depths.buffer.slice(0));

/** Depths of all tiles, then of all blocks of tiles. */
async function trace(
  bench: Bench,
  camera: Camera,
  last: Camera,
  lastDepths: Float32Array,
  isKnown = true,
): Promise<Float32Array> {
  const bytes = new ArrayBuffer(layouts.OcclusionView.size);
  writeStruct(layouts.OcclusionView, occlusionView(camera, last, TILES, isKnown), bytes);
  const depths = bench.buffer(4 * (COUNT + BLOCKS[0] * BLOCKS[1]));
  const stage = new OcclusionDepthsStage(bench.device);
  const bindings = stage.bind({
    view: bench.uniform(...new Uint32Array(bytes)),
    last_depths: bench.buffer(toBits(lastDepths)),
    depths,
  });
  bench.compute((pass) => stage.record(pass, bindings, TILES));
  return new Float32Array((await bench.read(depths)).buffer);
}

const randomDepths = (seed: number, least = 1, most = 9): Float32Array => {
  const random = randomSource(seed);
  return Float32Array.from({ length: COUNT }, () => least + (most - least) * random());
};

/** A point in world coordinates, seen through a pixel at a depth. */
function pointThrough({ fx, fy, cx, cy, worldToCamera }: Camera, x: number, y: number, depth: number): Vector3 {
  const m = inverse(worldToCamera);
  const p = [((x - cx) / fx) * depth, ((y - cy) / fy) * depth, depth];
  const row = (i: number): number => m[4 * i] * p[0] + m[4 * i + 1] * p[1] + m[4 * i + 2] * p[2] + m[4 * i + 3];
  return [row(0), row(1), row(2)];
}

/** Whatever a tile saw up to its depth must not be hidden where it is now. @returns how many points were in view */
function checkKept(camera: Camera, last: Camera, lastDepths: Float32Array, depths: Float32Array): number {
  const random = randomSource(77);
  let inView = 0;
  for (let k = 0; k < 4000; k++) {
    const [x, y] = [SIZE.width * random(), SIZE.height * random()];
    const tile = Math.floor(y / TILE) * TILES[0] + Math.floor(x / TILE);
    const [px, py, depth] = toCamera(camera, pointThrough(last, x, y, lastDepths[tile]));
    const [u, v] = [(camera.fx * px) / depth + camera.cx, (camera.fy * py) / depth + camera.cy];
    if (!(depth > 0 && u >= 0 && v >= 0 && u < SIZE.width && v < SIZE.height)) continue;
    const now = depths[Math.floor(v / TILE) * TILES[0] + Math.floor(u / TILE)];
    check(now >= depth, `a point at depth ${depth} lies behind the ${now} of its tile`);
    inView++;
  }
  return inView;
}

const open = (depths: Float32Array): number => depths.subarray(0, COUNT).filter((depth) => depth === Infinity).length;

const LAST = cameraAt([0, 0, -5], [0, 0, 0], SIZE);

export const occlusionCases: StageCase[] = [
  {
    name: 'occlusion depths: a camera at rest keeps what each tile saw; blocks take the farthest of their tiles',
    run: async (bench) => {
      const lastDepths = randomDepths(1);
      lastDepths[23] = Infinity;
      const depths = await trace(bench, LAST, LAST, lastDepths);
      for (let i = 0; i < COUNT; i++) {
        const expected = MARGIN * lastDepths[i];
        check(depths[i] === expected || Math.abs(depths[i] - expected) < 1e-5 * expected, `tile ${i}: ${depths[i]}`);
      }
      for (let block = 0; block < BLOCKS[0] * BLOCKS[1]; block++) {
        const [bx, by] = [block % BLOCKS[0], Math.floor(block / BLOCKS[0])];
        const own = depths.subarray(0, COUNT).filter((_, i) => {
          const [x, y] = [i % TILES[0], Math.floor(i / TILES[0])];
          return Math.floor(x / OCCLUSION_BLOCK) === bx && Math.floor(y / OCCLUSION_BLOCK) === by;
        });
        check(depths[COUNT + block] === Math.max(...own), `block ${block}: ${depths[COUNT + block]}`);
      }
    },
  },
  {
    name: 'occlusion depths: a camera that turns keeps what comes along, and opens what comes in',
    run: async (bench) => {
      const lastDepths = randomDepths(2);
      const turned = cameraAt([0, 0, -5], [0.35, -0.12, 0], SIZE);
      const depths = await trace(bench, turned, LAST, lastDepths);
      check(checkKept(turned, LAST, lastDepths, depths) > 3000, 'hardly anything is in view');
      check(open(depths) > 0 && open(depths) < COUNT / 2, `${open(depths)} of ${COUNT} tiles are open`);
    },
  },
  {
    name: 'occlusion depths: a camera that moves keeps a wall that comes nearer, and one that slides by',
    run: async (bench) => {
      for (const eye of [
        [0, 0, -4.6],
        [0.3, 0.1, -5],
        [-0.2, 0, -5.3],
      ] as const) {
        const lastDepths = new Float32Array(COUNT).fill(4);
        const moved = cameraAt(eye, [eye[0], eye[1], 0], SIZE);
        const depths = await trace(bench, moved, LAST, lastDepths);
        check(checkKept(moved, LAST, lastDepths, depths) > 2500, 'hardly anything is in view');
        check(open(depths) < COUNT / 2, `${open(depths)} of ${COUNT} tiles are open`);
      }
    },
  },
  {
    name: 'occlusion depths: all is open after a jump, and where nothing is known',
    run: async (bench) => {
      const away = cameraAt([0, 0, -5], [9, 0, -5], SIZE);
      for (const [camera, isKnown] of [
        [LAST, false],
        [away, true],
      ] as const) {
        const depths = await trace(bench, camera, LAST, randomDepths(3), isKnown);
        checkEqual(toBits(depths), new Uint32Array(depths.length).fill(OPEN), 'depths');
      }
    },
  },
  {
    name: 'cull: splats behind the depths of all their tiles are left out, all others stay',
    run: async (bench) => {
      const random = randomSource(8);
      const cloud = cloudOf(
        repeat(900, () => ({
          position: [4 * (random() - 0.5), 3 * (random() - 0.5), 6 * (random() - 0.5)],
          scale: random() < 0.2 ? 0.4 : 0.02,
          opacity: 0.9,
          color: [0, 0, 0],
        })),
      );
      const packed = packGaussians(cloud);
      const tileDepths = randomDepths(9, 2, 9);
      const depths = await trace(bench, LAST, LAST, tileDepths);
      const all = await cullOnGpu(bench, packed, LAST);
      const some = await cullOnGpu(bench, packed, LAST, { tiles: TILES, depths: toBits(depths) });
      const slots = mortonOrder(
        cloud.positions,
        Uint32Array.from({ length: cloud.count }, (_, i) => i),
      );
      const radius = Math.sqrt(2 * Math.log(255 * 0.9));
      const counts = { hidden: 0, shown: 0 };
      slots.forEach((i, slot) => {
        check(all.visible[slot] || !some.visible[slot], `splat ${i} appeared`);
        if (!all.visible[slot]) return;
        const [x, y, z] = toCamera(LAST, [0, 1, 2].map((k) => cloud.positions[3 * i + k]) as unknown as Vector3);
        const [u, v] = [(LAST.fx * x) / z + LAST.cx, (LAST.fy * y) / z + LAST.cy];
        // Spheres seen off the axis are stretched by less than a fifth.
        const reach = radius * Math.hypot((LAST.fx * cloud.scales[3 * i]) / z, Math.sqrt(0.3));
        const farthest = (r: number): number => {
          let depth = 0;
          const tile = (at: number, size: number): number => Math.floor(Math.min(size - 1, Math.max(0, at)) / TILE);
          for (let ty = tile(v - r, SIZE.height); ty <= tile(v + r, SIZE.height); ty++)
            for (let tx = tile(u - r, SIZE.width); tx <= tile(u + r, SIZE.width); tx++)
              depth = Math.max(depth, depths[ty * TILES[0] + tx]);
          return depth;
        };
        if (z <= farthest(0.8 * reach - 1)) check(some.visible[slot], `splat ${i} was left out though it may show`);
        const isSmall = reach < TILE;
        if (isSmall && z > farthest(1.2 * reach + 1)) check(!some.visible[slot], `splat ${i} shows through`);
        counts[some.visible[slot] ? 'shown' : 'hidden']++;
      });
      check(counts.hidden > 100 && counts.shown > 100, `${counts.hidden} hidden, ${counts.shown} shown`);
    },
  },
];
