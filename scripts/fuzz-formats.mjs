/**
 * `npm run lab -- fuzz-formats [READER ...] [--count N] [--seed S]`: 20,000 hostile files of every reader, damaged or with a
 * part multiplied, each read as the element does. The first that is neither read nor refused by name, or costs more than
 * SECURITY.md says, ends its reader and is named; the same seed makes it again.
 */
import { spawn } from 'node:child_process';
import { availableParallelism } from 'node:os';
import { fileURLToPath } from 'node:url';
import { parseArgs } from 'node:util';
import { ensureDependencies, ensurePackages } from './lib/prepare.mjs';
import { root } from './lib/run.mjs';

ensureDependencies();
ensurePackages();
const { register } = await import('tsx/esm/api');
register();
const { allReaders } = await import('../tests/formats/support/fuzz.ts');

const { values, positionals } = parseArgs({
  allowPositionals: true,
  options: { count: { type: 'string', default: '20000' }, seed: { type: 'string', default: '1' } },
});
const SCRIPT = fileURLToPath(new URL('../tests/formats/support/fuzz-run.ts', import.meta.url));
/** Files of one process, whose memory does not return to the system. */
const PER_PROCESS = 5000;

/** Reads a range of hostile files with the heap of a small device. Resolves to its tally, or to what went wrong. */
function run(reader, first, count) {
  const options = ['--max-old-space-size=300', '--import', 'tsx', SCRIPT, reader, first, count, values.seed].map(
    String,
  );
  const child = spawn(process.execPath, options, { cwd: root });
  let [out, said] = ['', ''];
  child.stdout.on('data', (data) => (out += data));
  child.stderr.on('data', (data) => (said = (said + data).slice(-4000)));
  return new Promise((resolve) => {
    child.on('close', () => {
      if (out !== '') return resolve(JSON.parse(out));
      const last = said.match(/^\d+$/gm)?.at(-1);
      const error = /Error: .*/.exec(said)?.[0] ?? 'the process ended';
      resolve({ fault: `${reader}, file ${last} of seed ${values.seed}: ${error}` });
    });
  });
}

async function fuzz(reader) {
  const start = performance.now();
  const sum = { files: 0, read: 0, refused: 0, codes: {}, shares: {} };
  for (let first = 0; first < Number(values.count); first += PER_PROCESS) {
    const tally = await run(reader, first, Math.min(PER_PROCESS, Number(values.count) - first));
    if (tally.fault) return (console.error(tally.fault), 1);
    for (const key of ['files', 'read', 'refused']) sum[key] += tally[key];
    for (const [code, count] of Object.entries(tally.codes)) sum.codes[code] = (sum.codes[code] ?? 0) + count;
    for (const [cost, share] of Object.entries(tally.shares)) sum.shares[cost] = Math.max(sum.shares[cost] ?? 0, share);
  }
  const codes = Object.entries(sum.codes).map(([code, count]) => `${code} ${count}`);
  const shares = Object.entries(sum.shares).map(([cost, share]) => `${cost} ${(100 * share).toFixed(0)} %`);
  const seconds = ((performance.now() - start) / 1000).toFixed(0);
  console.log(
    `${reader.padEnd(14)} ${sum.files} files in ${seconds} s: ${sum.read} read, ${sum.refused} refused (${codes.join(', ')}); ` +
      `at most, of the bounds: ${shares.join(', ')}`,
  );
  return 0;
}

const left = Object.keys(await allReaders()).filter((name) => positionals.length === 0 || positionals.includes(name));
let faults = 0;
await Promise.all(
  Array.from({ length: Math.max(1, availableParallelism() - 1) }, async () => {
    for (let reader = left.shift(); reader; reader = left.shift()) faults += await fuzz(reader);
  }),
);
process.exit(faults > 0 ? 1 : 0);
