/**
 * Any scene file that this project reads, as a PLY of plain colors for make_views.py: node to_ply.mjs SCENE OUT.ply [--turn]
 * `--turn` turns it by 180 degrees about z. Needs `npm run build`.
 */
import { readFileSync, writeFileSync } from 'node:fs';
import { readScene } from '@gaussian-splat/formats';

const [source, out, turn] = process.argv.slice(2);
const cloud = await readScene(new Uint8Array(readFileSync(source)), { name: source });
const columns = [
  'x',
  'y',
  'z',
  'f_dc_0',
  'f_dc_1',
  'f_dc_2',
  'opacity',
  'scale_0',
  'scale_1',
  'scale_2',
  'rot_0',
  'rot_1',
  'rot_2',
  'rot_3',
];
const rows = new Float32Array(cloud.count * columns.length);
const first = 3 * (cloud.shDegree + 1) ** 2;
const sign = turn === '--turn' ? -1 : 1;
const logit = (opacity) => Math.log(opacity / (1 - opacity));
for (let i = 0; i < cloud.count; i++) {
  const [x, y, z] = [0, 1, 2].map((axis) => cloud.positions[3 * i + axis] + cloud.origin[axis]);
  const [qw, qx, qy, qz] = cloud.rotations.subarray(4 * i, 4 * i + 4);
  // Half a turn about z, times the quaternion: (0, 0, 0, 1) (w, x, y, z).
  const rotation = sign < 0 ? [-qz, -qy, qx, qw] : [qw, qx, qy, qz];
  const opacity = logit(Math.min(Math.max(cloud.opacities[i], 1e-6), 1 - 1e-6));
  const scales = Array.from(cloud.scales.subarray(3 * i, 3 * i + 3), (scale) => Math.log(Math.max(scale, 1e-9)));
  const color = cloud.sh.subarray(first * i, first * i + 3);
  rows.set([sign * x, sign * y, z, ...color, opacity, ...scales, ...rotation], i * columns.length);
}
const header = ['ply', 'format binary_little_endian 1.0', `element vertex ${cloud.count}`];
header.push(...columns.map((name) => `property float ${name}`), 'end_header', '');
writeFileSync(out, Buffer.concat([Buffer.from(header.join('\n')), Buffer.from(rows.buffer)]));
console.log(`${out}: ${cloud.count} Gaussians`);
