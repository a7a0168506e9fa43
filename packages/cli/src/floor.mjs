/** Implementation of `gaussian-splat floor`: reads a scene, finds its walkable floor, and writes it as a map. */
import { readScene } from '@gaussian-splat/formats';
import {
  encodeFloorMap,
  floorOf,
  isVoxelPath,
  makeFloorMap,
  readVoxels,
  voxelTreePath,
} from '@gaussian-splat/formats/floor';
import { basename, resolve } from 'node:path';
import { CommandError, parseSceneOptions, report, runCommand, sayWarnings, UsageError } from './lib/command.mjs';
import { readerBeside, readWhole } from './lib/input-file.mjs';
import { checkOutput, writeWhole } from './lib/output-file.mjs';

const USAGE = `usage: gaussian-splat floor SCENE|VOXELS.voxel.json --out FILE.floor [options]

  --out FILE      the map, for the attribute walk-map
  --unit LENGTH   length of one unit of the scene, such as 1m or 37cm; default 1m
  --up DIRECTION  what points up in the scene: x, -x, y, -y, z, -z or a vector such as "0.1 -1 0.2"; default: what the file says, else -y
  --near X,Y,Z    point, meters and y up, below which the walk starts; default: the middle of the scene
  --eyes LENGTH   height of a walker's eyes; default 1.6m
  --cell LENGTH   edge of a cell of the map; default 5cm
`;

const METERS = { m: 1, cm: 0.01, mm: 0.001 };
/** Free height in meters above the eyes of a body, the same as in the element. */
const ABOVE_EYES = 0.1;
/** Directions of the names that the option --up takes besides vectors. */
const AXES = { x: [1, 0, 0], '-x': [-1, 0, 0], y: [0, 1, 0], '-y': [0, -1, 0], z: [0, 0, 1], '-z': [0, 0, -1] };

/** Returns the unit vector of an axis name or of three numbers; undefined for any other text. */
function directionOf(text) {
  const vector = Object.hasOwn(AXES, text)
    ? AXES[text]
    : text
        .trim()
        .split(/[\s,]+/)
        .map(Number);
  const length = Math.hypot(...vector);
  if (vector.length !== 3 || !(length > 0 && length < Infinity)) return undefined;
  return vector.map((value) => value / length);
}

/** Returns the rows of the rotation of a unit vector to +y, the same as in the element. */
function frameOf([x, y, z]) {
  const side = y < 0 ? -1 : 1;
  const share = 1 / (1 + side * y);
  const both = share * x * z;
  return [
    [1 - share * x * x, -side * x, -both],
    [x, y, z],
    [-side * both, -z, side * (1 - share * z * z)],
  ];
}

function parseOptions(args) {
  const text = { type: 'string' };
  const parsed = parseSceneOptions(args, {
    ...{ out: text, up: text, near: text },
    ...{ unit: { ...text, default: '1m' }, eyes: { ...text, default: '1.6m' }, cell: { ...text, default: '5cm' } },
  });
  if (parsed === undefined) return undefined;
  const { values, scene } = parsed;
  if (values.out === undefined) throw new UsageError('--out is missing');
  checkOutput('out', values.out, { [scene]: scene });
  const up = values.up === undefined ? undefined : directionOf(values.up);
  if (values.up !== undefined && up === undefined)
    throw new UsageError(`--up: expected x, -x, y, -y, z, -z or three numbers, found "${values.up}"`);
  const near = values.near?.split(',').map(Number);
  if (near && (near.length !== 3 || !near.every(Number.isFinite)))
    throw new UsageError(`--near: expected X,Y,Z, found "${values.near}"`);
  const length = (name) => {
    const [, number, unit] = /^(\d+\.?\d*|\.\d+)(m|cm|mm)$/.exec(values[name]) ?? [];
    if (!(Number(number) > 0))
      throw new UsageError(`--${name}: expected a length such as 1.6m or 37cm, found "${values[name]}"`);
    return Number(number) * METERS[unit];
  };
  return {
    scene: resolve(scene),
    out: resolve(values.out),
    up,
    options: { near, metersPerUnit: length('unit'), voxel: length('cell'), height: length('eyes') + ABOVE_EYES },
  };
}

/** Finds the floor of a scene from the voxels that splat-transform has written. */
async function floorOfVoxels(scene, up, options) {
  const files = { head: await readWhole(scene), tree: await readWhole(voxelTreePath(scene)), name: basename(scene) };
  const { grid, solid } = readVoxels(files, frameOf(up ?? AXES['-y']), options.metersPerUnit);
  return floorOf(grid, solid, options);
}

async function floorOfScene(scene, up, options) {
  const cloud = await readScene(await readWhole(scene), { name: basename(scene), openFile: readerBeside(scene) });
  sayWarnings(basename(scene), cloud);
  report({ splats: cloud.count });
  return makeFloorMap(cloud, { ...options, frame: frameOf(up ?? cloud.hints?.up ?? AXES['-y']) });
}

async function main({ scene, out, up, options }) {
  const map = await (isVoxelPath(scene) ? floorOfVoxels : floorOfScene)(scene, up, options);
  if (map.layers.length === 0)
    throw new CommandError(
      `${basename(scene)} has no floor: check --up and --unit, or name a point above it with --near`,
    );
  const bytes = encodeFloorMap(map);
  writeWhole(out, bytes);
  const heights = map.layers.flatMap((layer) => [...layer].filter((height) => !Number.isNaN(height)));
  const range = [Math.min, Math.max].map((pick) => heights.reduce((a, b) => pick(a, b)).toFixed(2));
  console.log(
    `${out}: ${map.area.toFixed(1)} m² of floor at heights ${range.join(' to ')} m, cells of ${(100 * map.cell).toFixed(1)} cm, ${bytes.length} bytes`,
  );
}

await runCommand(USAGE, parseOptions, main, {
  name: 'floor',
  endings: ['.floor'],
  accepts: (path, isScene) => isScene(path) || isVoxelPath(path),
});
