/** The work behind `npm run lab -- soak`. */
import { writeFileSync } from 'node:fs';
import { parseArgs } from 'node:util';
import { chromium } from 'playwright-core';
import { PNG } from 'pngjs';
import { findChromium, gpuFlags } from '../lib/chromium.mjs';
import { root } from '../lib/run.mjs';
import { serve } from '../../packages/cli/src/lib/server.mjs';
import { residentBytes } from './processes.mjs';
import { heapSlope } from './slope.mjs';
import { summaryLine } from './summary.mjs';

const USAGE = `usage: npm run lab -- soak [--minutes N (default 120)] [--seed S] [--out FILE] [--max-mib N (default 6144)]

Every five minutes a line that begins with "summary:" reports the progress, and FILE has the report until then. Ends with an error once the
browser's processes hold more memory than --max-mib together (on Linux only).`;
const ANCHOR = { x: 0, y: 0, width: 160, height: 120 };
/** Actions between two checks of the ledger. */
const EPOCH = 30;
/** Looks at the books, two seconds apart, before a byte too many counts as lost. */
const TIMEOUT = 8;
/** Minutes between two summaries. */
const SUMMARY_EVERY = 5;
/** Messages of a page about files that are damaged or missing on purpose. */
const EXPECTED = [
  /truncated\.ply|none\.ply|faulty-run|faulty/i,
  /404/,
  /pose expects|camera-orbit/,
  /does not name its axes/,
];

const { values } = parseArgs({
  options: {
    minutes: { type: 'string', default: '120' },
    seed: { type: 'string', default: '1' },
    out: { type: 'string' },
    'max-mib': { type: 'string', default: '6144' },
    help: { type: 'boolean' },
  },
});
if (values.help) {
  console.log(USAGE);
  process.exit(0);
}

/** mulberry32: the same walk for the same seed, as far as timing allows. */
function randomSource(seed) {
  let state = seed >>> 0;
  return () => {
    state = (state + 0x6d2b79f5) >>> 0;
    let t = Math.imul(state ^ (state >>> 15), state | 1);
    t ^= t + Math.imul(t ^ (t >>> 7), t | 61);
    return ((t ^ (t >>> 14)) >>> 0) / 4294967296;
  };
}

const server = await serve({
  '/': `${root}demo/dist`,
  '/soak/': `${root}scripts/soak`,
  '/cdn/': `${root}packages/element/cdn`,
  '/iwer/': `${root}node_modules/iwer/build`,
  '/fixtures/': `${root}tests/element/browser/fixtures`,
  '/generators/': `${root}tests/fixtures/generators`,
});
const browser = await chromium.launch({ executablePath: findChromium(), args: gpuFlags() });
const failures = [];
/** Errors of the page since the last epoch that were not expected. */
const faults = [];
try {
  const report = await soak(await browser.newPage({ viewport: { width: 800, height: 600 } }));
  console.log(JSON.stringify(report, null, 2));
  keep(report);
} catch (error) {
  failures.push(String(error));
} finally {
  await browser.close();
  server.closeAllConnections();
  server.close();
}
for (const failure of failures) console.error(`failed: ${failure}`);
process.exit(failures.length > 0 ? 1 : 0);

async function soak(page) {
  page.on('crash', () => failures.push('the page crashed'));
  await page.goto(`http://localhost:${server.address().port}/soak/index.html`);
  await page.waitForFunction(() => window.soak !== undefined);
  const devtools = await page.context().newCDPSession(page);
  const processes = await browser.newBrowserCDPSession();
  const actions = await page.evaluate(() => window.soak.actions);
  const random = randomSource(Number(values.seed));
  // The very first frames allocate permanent resources: the baseline is taken after one epoch of each action.
  await page.evaluate(() => window.soak.start());
  await walk(page, actions, random);
  const base = await look(page, devtools);
  const started = Date.now();
  const end = started + 60_000 * Number(values.minutes);
  const epochs = [];
  let performed = EPOCH;
  let summaries = 0;
  while (Date.now() < end && failures.length === 0) {
    await walk(page, actions, random);
    performed += EPOCH;
    let now = await look(page, devtools);
    // A load that was given up ends when the GPU process has answered; a leak stays.
    for (let tries = 0; tries < TIMEOUT && now.state.ledger.own !== base.state.ledger.own; tries++) {
      await page.waitForTimeout(2_000);
      now = await look(page, devtools);
    }
    const differing = differences(base.picture, now.picture);
    const resident = await residentBytes(processes);
    epochs.push({
      minutes: (Date.now() - started) / 60_000,
      heap: now.heap,
      own: now.state.ledger.own,
      others: now.state.ledger.others,
      resident,
    });
    const held = Object.values(resident ?? {}).reduce((sum, bytes) => sum + bytes, 0) / 2 ** 20;
    if (held > Number(values['max-mib'])) failures.push(`the browser holds ${held.toFixed(0)} MiB`);
    if (!now.state.loaded) failures.push(`the anchor is not loaded: ${now.state.error}`);
    if (differing > 0) failures.push(`${differing} color values of the anchor differ`);
    const grown = now.state.ledger.own - base.state.ledger.own;
    if (grown !== 0) {
      const detail = changes(base.state.ledger.byLabel, now.state.ledger.byLabel);
      failures.push(`${grown} bytes in the ledger: ${detail}`);
    }
    failures.push(...faults.splice(0));
    console.error(
      `${epochs.at(-1).minutes.toFixed(1)} min, ${performed} actions, heap ${(now.heap / 2 ** 20).toFixed(2)} MiB, ours ${now.state.ledger.own} bytes, ${differing} differing`,
    );
    if (epochs.at(-1).minutes >= SUMMARY_EVERY * (summaries + 1)) {
      summaries = Math.floor(epochs.at(-1).minutes / SUMMARY_EVERY);
      const events = await page.evaluate(() => window.soak.events());
      const { heap, state } = base;
      const start = { heap, own: state.ledger.own };
      console.error(summaryLine({ epochs, actions: performed, base: start, events, failures }));
      keep(reportOf(base, epochs, performed, events));
    }
  }
  const slope = heapSlope(epochs);
  if (Number(values.minutes) >= 60 && slope > 1) failures.push(`the heap grows by ${slope.toFixed(2)} MiB an hour`);
  return reportOf(base, epochs, performed, await page.evaluate(() => window.soak.events()));
}

function reportOf(base, epochs, actions, events) {
  const last = epochs.at(-1);
  return {
    seed: Number(values.seed),
    minutes: last?.minutes ?? 0,
    actions,
    epochs: epochs.length,
    events,
    ownBytes: { first: base.state.ledger.own, last: last?.own },
    otherBytes: { first: base.state.ledger.others, last: last?.others },
    heapMiB: { first: base.heap / 2 ** 20, last: (last?.heap ?? 0) / 2 ** 20, slopePerHour: heapSlope(epochs) },
    residentBytes: { first: epochs[0]?.resident, last: last?.resident },
    failures,
  };
}

function keep(report) {
  if (values.out) writeFileSync(values.out, `${JSON.stringify(report, null, 2)}\n`);
}

async function walk(page, actions, random) {
  for (let i = 0; i < EPOCH; i++) {
    // Losses are rarer than the rest: a device that is lost all the time is, rightly, given up.
    const name = actions[Math.floor(random() * actions.length)];
    if (name === 'loseDevice' && random() < 0.6) continue;
    const [which, a, b] = [random(), random(), random()];
    await page.evaluate(([name, which, a, b]) => window.soak.act(name, which, a, b), [name, which, a, b]);
    await page.waitForTimeout(random() < 0.3 ? 0 : Math.floor(900 * random()));
  }
}

/** State of the books once everything but the anchor is gone. */
async function look(page, devtools) {
  const state = await page.evaluate(() => window.soak.settle());
  await devtools.send('HeapProfiler.collectGarbage');
  await devtools.send('HeapProfiler.collectGarbage');
  const { usedSize } = await devtools.send('Runtime.getHeapUsage');
  const seen = await page.evaluate(() => window.soak.faults());
  faults.push(...seen.filter((text) => !EXPECTED.some((pattern) => pattern.test(text))));
  const image = PNG.sync.read(await page.screenshot({ clip: ANCHOR }));
  return { state, heap: usedSize, picture: image };
}

function changes(before, after) {
  const labels = Object.keys({ ...before, ...after }).filter((label) => before[label] !== after[label]);
  return labels.map((label) => `${label} ${before[label] ?? 0} to ${after[label] ?? 0}`).join(', ');
}

function differences(a, b) {
  return a.data.reduce((count, value, i) => count + (value === b.data[i] ? 0 : 1), 0);
}
