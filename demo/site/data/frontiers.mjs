/** The committed runs of `npm run lab -- frontier`: for each chart of docs/frontier the measurements, the adapter, and the date. */
import { readdirSync, readFileSync } from 'node:fs';
import { join } from 'node:path';
import { timeOf } from '../../../scripts/frontier/front.mjs';
import { raceOf } from '../race.mjs';
import { root } from '../../../scripts/lib/run.mjs';

const folder = join(root, 'docs/frontier');

export default function frontiers() {
  return readdirSync(folder)
    .filter((name) => name.startsWith('frontier-') && name.endsWith('.json'))
    .map((name) => describe(name.replace('.json', ''), JSON.parse(readFileSync(join(folder, name), 'utf8'))));
}

function describe(name, { environment, scene, results, standard }) {
  const { vendor, architecture, description } = environment.adapter;
  return {
    name,
    adapter: adapterName({ vendor, architecture, description }),
    date: environment.date.slice(0, 10),
    scene: { ...scene, splats: scene.splats.toLocaleString('en') },
    rows: results.filter(({ error }) => !error).map((result) => rowOf(result, standard)),
    first: raceOf({ results, standard }, SHOWN),
    race: raceOf({ results, standard }, ['default', 'PlayCanvas', 'Spark']),
    hasLpips: results.some(({ quality }) => quality?.lpips !== undefined),
  };
}

/** Configurations for most visitors: the qualities of the element, and the others in their defaults. All by one clock. */
const SHOWN = ['reference', 'default', 'balanced', 'fast', 'PlayCanvas', 'Spark'];

/** As it is usually called: makers and models say the same thing twice. */
function adapterName({ vendor, architecture, description }) {
  if (architecture === 'swiftshader') return 'SwiftShader, on a CPU';
  return description?.toLowerCase().startsWith(vendor)
    ? description
    : [vendor, architecture, description].filter(Boolean).join(' ');
}

function rowOf(result, standard) {
  const { configuration, quality, bytes } = result;
  const ms = timeOf(result, standard);
  return {
    name: configuration.name,
    milliseconds: Number(ms.toPrecision(3)).toLocaleString('en'),
    ratio: result.ratio?.burst?.p50.toFixed(2) ?? '',
    psnr: quality.psnr.toFixed(1),
    worst: quality.worst.toFixed(1),
    ssim: quality.ssim.toFixed(4),
    lpips: quality.lpips?.toFixed(4) ?? '',
    bytes: bytes?.perSplat.toFixed(0) ?? '',
  };
}
