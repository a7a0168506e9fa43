/** The work behind `npm run lab -- frontier`: collects in the browser, or reads results of another machine, and draws. */
import { mkdirSync, mkdtempSync, readFileSync, rmSync, writeFileSync } from 'node:fs';
import { tmpdir } from 'node:os';
import { join, resolve } from 'node:path';
import { parseArgs } from 'node:util';
import { adapterName } from '../../benchmarks/run/environment.js';
import { runMetrics } from '../../packages/cli/src/lib/gate/gate.mjs';
import { runPage } from '../lib/browser-page.mjs';
import { root } from '../lib/run.mjs';
import { drawChart } from './chart.mjs';
import { bytesASplat, hypervolume, nonDominated, passing, perceptual, pointsOf, timeOf } from './front.mjs';

const USAGE = `usage: npm run lab -- frontier [options]

  --size WxH        image size (default 480x270)
  --splats N        splats; 0, the default, is the scene as it is
  --path NAME       camera path (default orbit)
  --distance F      of the path from the scene; default 0.5, at which it fills the image's height
  --views N         views that are compared with the reference (default 4)
  --frames N        frames of each visit (default 5)
  --rounds N        visits to each configuration, in alternating order (default 2)
  --only REGEX      only configurations whose name matches
  --scene FILE      your own scene instead of the included one
  --query TEXT      further parameters for the page's address, for example "reference=renderer"
  --python FILE     measures LPIPS, too, with a Python that has packages/cli/src/lib/gate/requirements.txt
  --from FILE       draws a report that the page posted on another machine; with images=1 in the page's address, LPIPS too
  --adapter NAME    the GPU's name, if the browser reports only its vendor
  --out FOLDER      where frontier-ADAPTER.json and .svg go (default docs/frontier)

The table is scripts/frontier/configurations.mjs. SwiftShader draws; GAUSSIAN_SPLAT_GPU=system takes this machine's GPU.
`;

const from = process.env.INIT_CWD ?? process.cwd();

function readOptions() {
  const text = (fallback) => ({ type: 'string', default: fallback });
  const { values } = parseArgs({
    options: {
      size: text('480x270'),
      splats: text('0'),
      path: text('orbit'),
      distance: text('0.5'),
      views: text('4'),
      frames: text('5'),
      rounds: text('2'),
      only: text(''),
      scene: { type: 'string' },
      query: text(''),
      python: { type: 'string' },
      from: { type: 'string' },
      adapter: { type: 'string' },
      out: text(join(root, 'docs/frontier')),
      help: { type: 'boolean' },
    },
  });
  return values;
}

async function collect({ size, splats, path, distance, views, frames, rounds, only, scene, python, query }) {
  const asked = {
    sizes: size,
    splats,
    paths: path,
    distance,
    views,
    frames,
    rounds,
    only,
    warmup: '2',
    phases: 'burst,wall,gpu',
    images: python && '1',
  };
  const more = Object.fromEntries(new URLSearchParams(query));
  return runPage(
    'bench/frontier.html',
    { ...asked, ...more },
    {
      scene: scene && resolve(from, scene),
      minutes: 60,
      onProgress: (line) => console.error(line),
    },
  );
}

/** Moves the images out of a report, and adds the LPIPS of each configuration's worst view to its metrics. */
function measureLpips({ reference, results }, python) {
  const folder = mkdtempSync(join(tmpdir(), 'frontier-'));
  const write = (name, images) =>
    images.map((url, k) => {
      const path = join(folder, `${name}-${k}.png`);
      writeFileSync(path, Buffer.from(url.slice(url.indexOf(',') + 1), 'base64'));
      return path;
    });
  try {
    const compared = results.filter(({ images }) => images);
    const expected = write('reference', reference.images);
    const pairs = compared.flatMap(({ images }, n) => write(n, images).map((path, k) => [path, expected[k]]));
    const { rows, withoutLpips } = runMetrics(python, pairs);
    if (withoutLpips) throw new Error(`LPIPS cannot be measured: ${withoutLpips}`);
    for (const [n, { quality }] of compared.entries()) {
      const own = rows.slice(expected.length * n, expected.length * (n + 1));
      quality.lpips = Number(Math.max(...own.map(({ lpips }) => lpips)).toFixed(5));
    }
  } finally {
    rmSync(folder, { recursive: true });
  }
  delete reference.images;
  for (const result of results) delete result.images;
}

/** Part of a file's name that distinguishes adapters. */
function slugOf(adapter) {
  const name = /swiftshader/i.test(adapterName(adapter)) ? 'swiftshader' : adapterName(adapter);
  return name
    .toLowerCase()
    .replace(/[^a-z0-9]+/g, '-')
    .replace(/^-|-$/g, '')
    .slice(0, 40);
}

function describe(report) {
  const points = pointsOf(report);
  const front = new Set(nonDominated(points).map(({ name }) => name));
  const lines = report.results.map((result) => {
    const { configuration, error, quality } = result;
    const bytes = bytesASplat(result, report.scene)?.toFixed(1);
    const { name } = configuration;
    if (error) return `  ${name.padEnd(28)} left out: ${error.split('\n')[0]}`;
    const time = timeOf(result, report.standard).toFixed(2);
    const numbers = `${time.padStart(9)} ms ${quality.psnr.toFixed(2).padStart(7)} dB  p99.9 ${quality.p999.toFixed(2)}  worst ${quality.worst.toFixed(1)}  ${perceptual(quality)}${bytes ? `  ${bytes} B` : ''}`;
    return `${front.has(name) ? '*' : ' '} ${name.padEnd(28)}${numbers}`;
  });
  const area = hypervolume(points);
  const tiers = points.filter(({ tier }) => tier === 'tier');
  const passed = tiers.map((tier) => [tier.name, passing(tier, points).map(({ name }) => name)]);
  return [
    ...lines,
    `* nothing is both faster and more accurate; ${area.toFixed(2)} decades x dB within 16.6 ms and above 36 dB`,
    ...passed.map(
      ([name, by]) =>
        `  ${name}: ${by.length > 0 ? `passed by ${by.join(', ')}` : 'nothing is as fast, as accurate and as small, and clearly better in one of these'}`,
    ),
  ].join('\n');
}

async function main() {
  const options = readOptions();
  if (options.help) return console.log(USAGE);
  const report = options.from ? JSON.parse(readFileSync(resolve(from, options.from), 'utf8')) : await collect(options);
  if (report.kind !== 'frontier')
    throw new Error(`expected the report of bench/frontier.html, found kind "${report.kind}"`);
  if (report.error) throw new Error(report.error);
  if (report.reference.images && !options.python)
    throw new Error('--python: expected a Python that measures LPIPS, because the report has images, found none');
  if (report.reference.images) measureLpips(report, options.python);
  if (options.adapter) report.environment.adapter.description = options.adapter;
  const folder = resolve(from, options.out);
  mkdirSync(folder, { recursive: true });
  const name = join(folder, `frontier-${slugOf(report.environment.adapter)}`);
  writeFileSync(`${name}.json`, `${JSON.stringify(report, null, 2)}\n`);
  writeFileSync(`${name}.svg`, drawChart(report));
  writeFileSync(`${name}-small.svg`, drawChart(report, 'small'));
  console.log(describe(report));
  console.log(`${name}.svg`);
  if (report.errors.length > 0) throw new Error(`WebGPU: ${report.errors.join('\n')}`);
}

try {
  await main();
} catch (error) {
  console.error(`${error.message}\n\n${USAGE}`);
  process.exit(1);
}
