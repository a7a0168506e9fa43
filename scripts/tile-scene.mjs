/** Sets copies of a scene side by side on its ground, as a PLY: a larger scene to time `gaussian-splat optimize` with. See packages/optimize/README.md. */
import { readFileSync, writeFileSync } from 'node:fs';
import { encodingsFor } from '@gaussian-splat/optimize';
import { readScene } from '@gaussian-splat/formats';

const USAGE =
  'usage: node scripts/tile-scene.mjs SCENE COPIES STEP OUT.ply    STEP: from one copy to the next, in the units of the scene';

const [path, copiesText, stepText, out] = process.argv.slice(2);
const [copies, step] = [Number(copiesText), Number(stepText)];
if (!(Number.isInteger(copies) && copies > 0 && Number.isFinite(step)) || out === undefined) {
  console.error(USAGE);
  process.exit(2);
}

const cloud = await readScene(readFileSync(path), { name: path });
const columns = Math.ceil(Math.sqrt(copies));
const count = copies * cloud.count;

/** The same numbers, repeated. */
function repeated(values) {
  const all = new Float32Array(copies * values.length);
  for (let copy = 0; copy < copies; copy++) all.set(values, copy * values.length);
  return all;
}

const positions = repeated(cloud.positions);
for (let i = 0; i < count; i++) {
  const copy = Math.floor(i / cloud.count);
  positions[3 * i] += step * ((copy % columns) - (columns - 1) / 2);
  positions[3 * i + 2] += step * (Math.floor(copy / columns) - (columns - 1) / 2);
}
const [scales, rotations, opacities, sh] = ['scales', 'rotations', 'opacities', 'sh'].map((name) =>
  repeated(cloud[name]),
);
const tiled = { ...cloud, count, positions, scales, rotations, opacities, sh };
const degrees = new Uint8Array(count).fill(cloud.shDegree);
writeFileSync(out, await encodingsFor(out)[0].write({ cloud: tiled, degrees }));
console.log(`${out}: ${count} splats`);
