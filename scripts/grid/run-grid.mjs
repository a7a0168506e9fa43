/**
 * `npm run lab -- grid`: twelve scenes on a page of a phone's size, scrolled up and down by a finger for a minute. Peak GPU memory is compared with the peak of the scenes in view. Tasks of the main thread are read from the browser's trace: their work, and their wait for the GPU.
 */
import { writeFileSync } from 'node:fs';
import { join } from 'node:path';
import { parseArgs } from 'node:util';
import { chromium, devices } from 'playwright-core';
import { serve } from '../../packages/cli/src/lib/server.mjs';
import { findChromium, gpuFlags } from '../lib/chromium.mjs';
import { root } from '../lib/run.mjs';
import { residentBytes } from '../soak/processes.mjs';
import { longTasksOf } from './trace.mjs';

const USAGE = `usage: npm run lab -- grid [--seconds N (default 60)] [--renderer webgl] [--ms N (of one swipe, default 250)] [--pixel-ratio N (default 1, for SwiftShader; 2.6 with a GPU)] [--out FILE]

Ends with an error if the GPU's memory exceeds 1.2 times that of the scenes in view, if a task works and waits for the GPU for more than 50 ms, or if a scene does not come.`;
const COUNT = 12;
const MAX_SHARE = 1.2;
const MAX_TASK_MS = 50;
/** Moves of a finger in one swipe. */
const STEPS = 15;
const { values } = parseArgs({
  options: {
    seconds: { type: 'string', default: '60' },
    renderer: { type: 'string', default: '' },
    ms: { type: 'string', default: '250' },
    'pixel-ratio': { type: 'string', default: '1' },
    out: { type: 'string' },
    help: { type: 'boolean' },
  },
});
if (values.help) {
  console.log(USAGE);
  process.exit(0);
}

const server = await serve({
  '/grid/': join(root, 'scripts/grid'),
  '/soak/': join(root, 'scripts/soak'),
  '/cdn/': join(root, 'packages/element/cdn'),
  '/scenes/': join(root, 'demo/scenes'),
});
const browser = await chromium.launch({ executablePath: findChromium(), args: gpuFlags() });
const processes = await browser.newBrowserCDPSession();
const failures = [];
try {
  const report = judge(await scroll());
  console.log(JSON.stringify(report, null, 2));
  if (values.out) writeFileSync(values.out, `${JSON.stringify(report, null, 2)}\n`);
} catch (error) {
  failures.push(error.message);
} finally {
  await browser.close();
  server.closeAllConnections();
  server.close();
}
for (const failure of failures) console.error(`failed: ${failure}`);
process.exit(failures.length > 0 ? 1 : 0);

/** A phone with 4 GB of memory. */
async function openPhone(query) {
  const { userAgent, viewport, isMobile, hasTouch } = devices['Pixel 7'];
  const context = await browser.newContext({
    ...{ userAgent, viewport, isMobile, hasTouch },
    deviceScaleFactor: Number(values['pixel-ratio']),
  });
  await context.addInitScript(() => Object.defineProperty(Navigator.prototype, 'deviceMemory', { get: () => 4 }));
  const page = await context.newPage();
  page.on('crash', () => failures.push('the page crashed'));
  const renderer = values.renderer && `&renderer=${values.renderer}`;
  await page.goto(`http://localhost:${server.address().port}/grid/index.html?${query}${renderer}`);
  await page.waitForFunction('window.grid');
  await page.evaluate('grid.settled()');
  return { context, page };
}

async function scroll() {
  const { context, page } = await openPhone(`count=${COUNT}`);
  const devtools = await context.newCDPSession(page);
  await page.evaluate('grid.start()');
  await browser.startTracing(page, { categories: ['toplevel', 'gpu', '__metadata'] });
  const end = performance.now() + 1000 * Number(values.seconds);
  const resident = [];
  for (let direction = 1; performance.now() < end;) {
    await swipe(devtools, direction);
    const atEnd = await page.evaluate('grid.atEnd()');
    if (atEnd) direction = -atEnd;
    // Visitors stop now and then, and look.
    if (atEnd || Math.random() < 0.2) await page.evaluate('grid.settled()');
    resident.push((await residentBytes(processes))?.['GPU'] ?? 0);
  }
  const tasks = longTasksOf(await browser.stopTracing(), MAX_TASK_MS);
  const report = await page.evaluate('grid.report()');
  await context.close();
  return { ...report, tasks, resident: Math.max(...resident) };
}

/** A finger moves over the page, and leaves it: by more than half of the view, and as far as its momentum goes. @param direction 1 for down the page, -1 for up */
async function swipe(devtools, direction) {
  const at = (share) => [{ x: 206, y: 420 + direction * 260 * (2 * share - 1), id: 1 }];
  const touch = (type, touchPoints) => devtools.send('Input.dispatchTouchEvent', { type, touchPoints });
  await touch('touchStart', at(1));
  for (let step = 1; step <= STEPS; step++) {
    await new Promise((resolve) => setTimeout(resolve, Number(values.ms) / STEPS));
    await touch('touchMove', at(1 - step / STEPS));
  }
  await touch('touchEnd', []);
  await new Promise((resolve) => setTimeout(resolve, 300));
}

function judge({ samples, longTasks, tasks, errors, loaded, resident }) {
  const max = (of) => Math.max(...samples.map(of));
  const peak = max(({ own, canvasBytes }) => own + canvasBytes);
  const share = peak / max(({ needed }) => needed);
  if (!(share <= MAX_SHARE)) failures.push(`${share.toFixed(2)} times the memory of the scenes in view`);
  const own = tasks.filter(({ cpuMs, gpuMs }) => cpuMs + gpuMs > MAX_TASK_MS);
  if (own.length > 0) failures.push(`${own.length} tasks of more than ${MAX_TASK_MS} ms`);
  failures.push(...errors);
  if (loaded < COUNT) failures.push(`${loaded} of ${COUNT} scenes came`);
  const megabytes = (bytes) => Math.round(bytes / 1e5) / 10;
  return {
    scenes: { inView: max(({ inView }) => inView), held: max(({ held }) => held), loaded },
    megabytes: {
      peak: megabytes(peak),
      inView: megabytes(max(({ needed }) => needed)),
      canvases: megabytes(max(({ canvasBytes }) => canvasBytes)),
      gpuProcess: megabytes(resident),
    },
    share: Math.round(100 * share) / 100,
    longTasks: longTasks.length,
    tasks,
    failures,
  };
}
