/** The work behind `npm run lab -- bench`. */
import { readFileSync, writeFileSync } from 'node:fs';
import { join, resolve } from 'node:path';
import { parseArgs } from 'node:util';
import { runPage } from '../lib/browser-page.mjs';
import { benchTable } from './table.mjs';

const USAGE = `usage: npm run lab -- bench [options]

  --splats N        splats; the scene is repeated up to that number (default 100000)
  --size WxH        image size (default 960x540)
  --path NAME       orbit (default), among, dolly, yaw, snap, zoom or strafe
  --frames N        frames of each visit (default 5)
  --rounds N        visits to each configuration, in alternating order (default 3)
  --scene FILE      your own scene instead of the included one
  --list FILE       JSON array of configurations to compare; default: ours, PlayCanvas and Spark
  --no-peers        ours alone
  --beside FOLDER   another checkout, built, whose renderer is measured in turns with this one
  --query TEXT      anything else for the page's address, for example "layout=overhead&phases=wall"
  --out FILE        where to write everything as JSON

SwiftShader draws, on the CPU; GAUSSIAN_SPLAT_GPU=system takes the GPU of this machine.
`;

/** The comparison's default list. */
const OURS = [{ name: 'ours' }];
/** Both builds in frames of their own, so that neither has an advantage. */
const BUILDS = [
  { name: 'this build', peer: 'ours' },
  { name: 'the other build', peer: 'ours', build: '/beside/bench/' },
];
const PEERS = [
  { name: 'PlayCanvas', peer: 'playcanvas' },
  { name: 'PlayCanvas, parity', peer: 'playcanvas', parity: true },
  { name: 'Spark', peer: 'spark' },
];

/** Folder that a person's relative paths start from: npm itself runs scripts in the project's root. */
const from = process.env.INIT_CWD ?? process.cwd();

function readOptions() {
  const text = (fallback) => ({ type: 'string', default: fallback });
  const { values } = parseArgs({
    allowNegative: true,
    options: {
      splats: text('100000'),
      size: text('960x540'),
      path: text('orbit'),
      frames: text('5'),
      rounds: text('3'),
      scene: { type: 'string' },
      list: { type: 'string' },
      peers: { type: 'boolean', default: true },
      beside: { type: 'string' },
      query: text(''),
      out: { type: 'string' },
      help: { type: 'boolean' },
    },
  });
  return values;
}

async function main() {
  const options = readOptions();
  if (options.help) return console.log(USAGE);
  const { splats, size, path, frames, rounds } = options;
  const list = options.list
    ? readFileSync(resolve(from, options.list), 'utf8')
    : JSON.stringify([...(options.beside ? BUILDS : OURS), ...(options.peers ? PEERS : [])]);
  const query = { list, splats, sizes: size, paths: path, frames, rounds, warmup: '3' };
  const more = Object.fromEntries(new URLSearchParams(options.query));
  const report = await runPage(
    'bench/index.html',
    { ...query, ...more },
    {
      scene: options.scene && resolve(from, options.scene),
      mounts: options.beside && { '/beside/': join(resolve(from, options.beside), 'demo/dist') },
      onProgress: (line) => console.error(line),
    },
  );
  if (options.out) writeFileSync(resolve(from, options.out), `${JSON.stringify(report, null, 2)}\n`);
  console.log(benchTable(report));
  if (report.errors.length > 0) throw new Error(`WebGPU: ${report.errors.join('\n')}`);
}

try {
  await main();
} catch (error) {
  console.error(`${error.message}\n\n${USAGE}`);
  process.exit(1);
}
