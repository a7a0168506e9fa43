/** The committed runs of `npm run lab -- frontier`: for each chart of docs/frontier the measurements, the adapter, and the date. */
import { readdirSync, readFileSync } from 'node:fs';
import { join } from 'node:path';
import { timeOf } from '../../../scripts/frontier/front.mjs';
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
    first: firstOf(results, standard),
    hasLpips: results.some(({ quality }) => quality?.lpips !== undefined),
  };
}

/**
 * Configurations for most visitors: the qualities of the element, and the others in their defaults. All by one clock.
 */
const QUALITIES = ['reference', 'default', 'balanced', 'fast'];
const OTHERS = ['PlayCanvas', 'Spark'];
/** Visibility of a difference in dB to the eye. */
const TO_THE_EYE = [
  [59, 'no difference on a display'],
  [42, 'hardly visible'],
  [36, 'visible beside the original'],
  [0, 'visible'],
];

function firstOf(results, standard) {
  const rows = [...QUALITIES, ...OTHERS].flatMap((wanted) => {
    const result = results.find(({ configuration, error }) => configuration.name === wanted && !error);
    return result
      ? [{ name: wanted, isOther: OTHERS.includes(wanted), ms: timeOf(result, standard), psnr: result.quality.psnr }]
      : [];
  });
  const max = Math.max(...rows.map(({ ms }) => ms));
  return rows.map(({ ms, psnr, ...row }) => ({
    ...row,
    milliseconds: ms < 10 ? ms.toPrecision(2) : Math.round(ms).toLocaleString('en'),
    share: (ms / max).toFixed(3),
    decibels: psnr.toFixed(0),
    eye: TO_THE_EYE.find(([min]) => psnr >= min)[1],
  }));
}

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
