/** `npm run lab -- detail-flight FOLDER`: the flight over a folder that `gaussian-splat detail` wrote, simulated, with and without page requests for predicted cameras. */
import { readFileSync } from 'node:fs';
import { join, resolve } from 'node:path';
import { checkManifest } from '@gaussian-splat/renderer';
import { FlightPages } from './flight-pages.js';
import { fly, type FlightSecond } from './flight.js';

const [given, ...values] = process.argv.slice(2);
if (given === undefined)
  throw new Error(
    'usage: npm run lab -- detail-flight FOLDER (of detail --quantized) [slots] [latency in ms] [bytes of a slot] [--copies] [--speed=SHARE]',
  );
const folder = resolve(process.env.INIT_CWD ?? process.cwd(), given);
const [slots = 17_500, latencyMs = 7, bytes = 65_856] = values.filter((value) => !value.startsWith('--')).map(Number);
const named = (name: string, fallback: number): number =>
  Number(values.find((value) => value.startsWith(`--${name}=`))?.split('=')[1] ?? fallback);
const manifest = checkManifest(JSON.parse(readFileSync(join(folder, 'detail.json'), 'utf8')), folder);
const files = new Map<string, ArrayBuffer>();
const fileOf = (file: string): ArrayBuffer => {
  if (!files.has(file)) files.set(file, new Uint8Array(readFileSync(join(folder, file))).buffer);
  return files.get(file)!;
};
const pages = new FlightPages(manifest, fileOf);
const options = {
  bounds: manifest.bounds,
  width: 1920,
  height: 1080,
  slots,
  bytes,
  warm: 3,
  seconds: 15,
  speed: named('speed', 1),
  latencyMs,
  bandwidth: 8e8,
  uploadMs: named('upload', 0.2),
  kept: 64e6,
  isWithoutCopies: !process.argv.includes('--copies'),
};
const mean = (rows: readonly FlightSecond[], of: (row: FlightSecond) => number): string =>
  (rows.reduce((sum, row) => sum + of(row), 0) / rows.length).toFixed(2);
console.log(`${pages.list.count} pages, ${slots} slots of ${bytes} bytes, ${latencyMs} ms until a page comes`);
for (const isStill of [true, false]) {
  const rows = await fly(pages, { ...options, isStill });
  console.log(isStill ? 'page requests of the view' : 'and of where it will be');
  console.log(`  degrees turned in each second: ${rows.map(({ turned }) => turned.toFixed(0)).join(' ')}`);
  console.log(`  pixels at the ends of seconds: ${rows.map(({ error }) => error.toFixed(1)).join(' ')}`);
  console.log(
    `  mean ${mean(rows, ({ error }) => error)}, of all frames ${mean(rows, (row) => row.mean)}; ${mean(rows, (row) => row.pages)} pages and ${mean(rows, (row) => row.files)} files a second`,
  );
}
