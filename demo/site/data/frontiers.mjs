/** The committed runs of `npm run frontier`: for each chart of docs/frontier what was measured, on what, and when. */
import { readdirSync, readFileSync } from 'node:fs';
import { join } from 'node:path';
import { root } from '../../../scripts/lib/run.mjs';

const folder = join(root, 'docs/frontier');

export default function frontiers() {
  return readdirSync(folder)
    .filter((name) => name.startsWith('frontier-') && name.endsWith('.json'))
    .map((name) => describe(name.replace('.json', ''), JSON.parse(readFileSync(join(folder, name), 'utf8'))));
}

function describe(name, { environment, scene, results }) {
  const { vendor, architecture, description } = environment.adapter;
  return {
    name,
    adapter: [vendor, architecture, description].filter(Boolean).join(' '),
    date: environment.date.slice(0, 10),
    scene: { ...scene, splats: scene.splats.toLocaleString('en') },
    rows: results.filter(({ error }) => !error).map(rowOf),
  };
}

function rowOf({ configuration, quality, span, sortedWall, wall }) {
  const cost = span ?? sortedWall ?? wall;
  return {
    name: configuration.name,
    milliseconds: cost ? Number(cost.p50.toPrecision(3)).toLocaleString('en') : '',
    clock: span ? 'GPU' : 'wall',
    psnr: quality.psnr.toFixed(1),
    worst: quality.worst.toFixed(1),
  };
}
