/** The work behind `npm run lab -- fuzz`: random scenes and cameras against the oracle. A fault is shrunk and kept in the corpus. */
import { writeFileSync } from 'node:fs';
import { parseArgs } from 'node:util';
import fc from 'fast-check';
import type { RasterizerName } from '@gaussian-splat/renderer';
import { nodeDevice } from '../../support/node-device.js';
import { fullDevice } from '../support/devices.js';
import { sceneRecipe, type SceneRecipe } from '../support/random-scene.js';
import { judge, type Cause, type Subject, type Verdict } from './judge.js';

const USAGE = `usage: npm run lab -- fuzz [options]

  --cases N        scenes (default 10000)
  --minutes M      stop after M minutes (default 240)
  --seed S         default: the time; the report names it
  --rasterizer R   quads (default) or tiles
  --below DB       also shrink the first frame below DB dB that no rounding explains, for any cause
  --out FILE       file for the report, as JSON
`;

interface Tally {
  cases: number;
  notFinite: number;
  worst: number;
  worstExplained: number;
  causes: Record<Cause, number>;
}

const { values } = parseArgs({
  options: {
    cases: { type: 'string', default: '10000' },
    minutes: { type: 'string', default: '240' },
    seed: { type: 'string' },
    rasterizer: { type: 'string', default: 'quads' },
    below: { type: 'string', default: '0' },
    out: { type: 'string' },
    help: { type: 'boolean' },
  },
});
if (values.help || !['quads', 'tiles'].includes(values.rasterizer)) {
  console.log(USAGE);
  process.exit(values.help ? 0 : 1);
}

const seed = Number(values.seed ?? Date.now() % 2 ** 31);
const rasterizer = values.rasterizer as RasterizerName;
const end = performance.now() + 60_000 * Number(values.minutes);
const precise = await fullDevice();
const subject: Subject = {
  device: await nodeDevice(),
  precise: precise.features.has('float32-blendable') ? precise : undefined,
  rasterizer,
};
const tally: Tally = {
  cases: 0,
  notFinite: 0,
  worst: Infinity,
  worstExplained: Infinity,
  causes: { fine: 0, threshold: 0, stop: 0, float16: 0, none: 0 },
};
let isLost = false;
void subject.device.lost.then(() => (isLost = true));
/** The lowest few, for the corpus. */
const lowest: { recipe: SceneRecipe; verdict: Verdict }[] = [];

function count(recipe: SceneRecipe, verdict: Verdict): void {
  tally.cases++;
  tally.notFinite += verdict.notFinite;
  tally.causes[verdict.cause]++;
  tally.worst = Math.min(tally.worst, verdict.decibels);
  tally.worstExplained = Math.min(tally.worstExplained, verdict.withoutThresholds);
  if (verdict.cause !== 'fine') lowest.push({ recipe, verdict });
  lowest.sort((a, b) => a.verdict.decibels - b.verdict.decibels).splice(5);
  if (tally.cases % 500 === 0) console.error(`${tally.cases} cases, worst ${tally.worst.toFixed(1)} dB`, tally.causes);
}

const failing = await fc.check(
  fc.asyncProperty(sceneRecipe, async (recipe) => {
    // Beyond the time everything passes, so that a failure found before is the one that is shrunk.
    if (performance.now() > end) return true;
    const verdict = await judge(recipe, subject);
    count(recipe, verdict);
    return verdict.cause !== 'none' && verdict.withoutThresholds >= Number(values.below) && !isLost;
  }),
  {
    numRuns: Number(values.cases),
    seed,
    interruptAfterTimeLimit: 60_000 * Number(values.minutes),
    markInterruptAsFailure: false,
  },
);

const report = { seed, rasterizer, isLost, ...tally, lowest: lowest.map(({ verdict }) => verdict) };
console.log(JSON.stringify(report, null, 2));
if (values.out) writeFileSync(values.out, `${JSON.stringify({ ...report, lowest }, null, 2)}\n`);
if (failing.counterexample) {
  const [recipe] = failing.counterexample;
  const verdict = await judge(recipe, subject);
  const file = new URL(`../corpus/${rasterizer}-${seed}.json`, import.meta.url);
  writeFileSync(file, `${JSON.stringify({ rasterizer, verdict, recipe })}\n`);
  const what = verdict.cause === 'none' ? 'A fault' : `Under ${values.below} dB`;
  console.error(`${what}: ${JSON.stringify(verdict)}. Its smallest case is kept in ${file.pathname}`);
}
process.exit(failing.counterexample || isLost ? 1 : 0);
