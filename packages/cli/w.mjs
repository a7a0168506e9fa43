import { readFileSync } from 'node:fs';
import { readScene } from '@gaussian-splat/formats';
import { buildDetailTree, codingOf, cutPages, PageEncoder, USUAL_STEPS } from '@gaussian-splat/renderer';
import { deflate } from './src/lib/deflate.mjs';
const cloud = await readScene(new Uint8Array(readFileSync('/work/shared/data/formats/playbot3.ply')), { name: 'a.ply' });
const tree = buildDetailTree(cloud, { geometry: 'quantized' });
const m = JSON.parse(readFileSync('/tmp/bytes/p-playbot/detail.json'));
console.log(m.coding);
let calls = [];
const enc = new PageEncoder(tree, { ...m.coding, place: 0.1 }, (b) => { const d = deflate(b); calls.push([b, d.length]); return d; });
const groups = {}; let splats = 0;
for (const page of cutPages(tree)) {
  calls = []; enc.encode(page);
  splats += calls[0][0].length;
  const names = ['place','place','place','place','place','place','size','size','size','dir','dir','dir','op','Y','Y','Co','Co','Cg','Cg','class'];
  calls.slice(0, -1).forEach(([b, l], k) => { if (k % 2) return; const p = k / 2; const n = p < 20 ? names[p] : 'h' + ['Y','Co','Cg'][(p - 20) % 3] + (p < 29 ? 1 : 2); groups[n] = (groups[n] ?? 0) + Math.min(l, calls[k + 1][1]); });
  groups.head = (groups.head ?? 0) + calls.at(-1)[1];
}
for (const k in groups) groups[k] = +(8 * groups[k] / splats).toFixed(2);
console.log(splats, cloud.count, groups);
