/**
 * `npm run lab -- fuzz-formats [FORMAT] [--count N] [--seed S]`: 10,000 damaged scenes of every format. The first that is neither read nor
 * refused by name, takes too long or too much memory ends the run and is named; the same seed makes it again.
 */
import { parseArgs } from 'node:util';
import { ensureDependencies, ensurePackages } from './lib/prepare.mjs';

ensureDependencies();
ensurePackages();
const { register } = await import('tsx/esm/api');
register();
const { fuzzFormat, fuzzScenes } = await import('../tests/formats/support/fuzz.ts');

const { values, positionals } = parseArgs({
  allowPositionals: true,
  options: { count: { type: 'string', default: '10000' }, seed: { type: 'string', default: '1' } },
});
const scenes = Object.entries(fuzzScenes()).filter(([name]) => positionals.length === 0 || positionals.includes(name));
for (const [name, files] of scenes) {
  const start = performance.now();
  const tally = await fuzzFormat(name, files, Number(values.count), Number(values.seed));
  const codes = Object.entries(tally.codes).map(([code, count]) => `${code} ${count}`);
  console.log(
    `${name.padEnd(14)} ${tally.files} files in ${((performance.now() - start) / 1000).toFixed(0)} s: ${tally.read} read, ${tally.refused} refused ` +
      `(${codes.join(', ')}); slowest ${tally.slowestMs.toFixed(0)} ms, most ${(tally.maxBytes / 1e6).toFixed(1)} MB`,
  );
}
