import { execFile } from 'node:child_process';
import { mkdtemp, readdir, readFile, rm } from 'node:fs/promises';
import { tmpdir } from 'node:os';
import { join } from 'node:path';
import { setTimeout as delay } from 'node:timers/promises';
import { promisify } from 'node:util';
import { gpuEnvironment } from '../../../../scripts/lib/gpu-environment.mjs';
import { endTraining, startTraining, trainingLog } from './training-server.mjs';

/** Commands that tests need from the browser and that a page cannot run: real touches, a real wheel, screenshots. */
export function pageCommands() {
  return {
    name: 'page-commands',
    executeCommand: async ({ command, payload, session }) => {
      const action = ACTIONS[command];
      if (action === undefined) return undefined;
      return (await action(session.browser.getPage(session.id), payload)) ?? true;
    },
  };
}

const ACTIONS = {
  /** A server of changing splats: see training-server.mjs. */
  'start-training': (_, options) => startTraining(options),
  'training-log': (_, url) => trainingLog(url),
  'end-training': (_, options) => endTraining(options),

  /** Touch points of one event: [] lifts all fingers. */
  'send-touch': (page, { type, points, ms }) =>
    devtools(page, 'Input.dispatchTouchEvent', { type, touchPoints: points, timestamp: ms && ms / 1000 }).then(
      () => true,
    ),

  'turn-wheel': async (page, { x, y, deltaY }) => {
    await page.mouse.move(x, y);
    await page.mouse.wheel(0, deltaY);
  },

  /** Bytes that scripts hold after a full collection of garbage. */
  'heap-size': async (page) => {
    await devtools(page, 'HeapProfiler.collectGarbage');
    return (await devtools(page, 'Runtime.getHeapUsage')).usedSize;
  },

  /** Counters and seconds of the main thread since it was opened: `ScriptDuration`, `RecalcStyleDuration`, `RecalcStyleCount`, `LayoutCount` and the others of DevTools. */
  'thread-metrics': async (page) => {
    await devtools(page, 'Performance.enable', { timeDomain: 'threadTicks' });
    const { metrics } = await devtools(page, 'Performance.getMetrics');
    return Object.fromEntries(metrics.map(({ name, value }) => [name, value]));
  },

  /** Ends the browser's GPU process as a crash would. */
  'kill-gpu-process': async (page) => {
    const browser = await page.context().browser().newBrowserCDPSession();
    const { processInfo } = await browser.send('SystemInfo.getProcessInfo');
    await browser.detach();
    const gpu = processInfo.find(({ type }) => type === 'GPU');
    if (gpu) process.kill(gpu.id, 'SIGKILL');
    return gpu !== undefined;
  },

  /** The image that the browser composites for a rectangle in CSS pixels: a PNG as base64, or `later` if it is pending and must be requested again. */
  screenshot: async (page, clip) => {
    const taken = images.get(page) ?? page.screenshot({ clip, timeout: 0 });
    images.set(page, taken);
    const image = await Promise.race([taken, delay(TIMEOUT_MS, 'later')]);
    if (image === 'later') return image;
    images.delete(page);
    return image.toString('base64');
  },

  /** Frames that `gaussian-splat video` writes with these arguments, as PNGs in base64, or `later` if they are pending. */
  'video-frames': async (page, args) => {
    const key = JSON.stringify(args);
    if (!videos.has(key)) videos.set(key, videoFrames(args));
    return Promise.race([videos.get(key), delay(TIMEOUT_MS, 'later')]);
  },
};

const videos = new Map();

async function videoFrames(args) {
  const folder = await mkdtemp(join(tmpdir(), 'video-'));
  const command = ['packages/cli/bin/gaussian-splat.mjs', 'video', ...args, '--out', folder];
  const env = { ...process.env, ...gpuEnvironment() };
  try {
    await promisify(execFile)(process.execPath, command, { env });
    const names = (await readdir(folder)).sort();
    return await Promise.all(names.map((name) => readFile(join(folder, name), 'base64')));
  } finally {
    await rm(folder, { recursive: true });
  }
}

/**
 * Pages get an answer within this time, since their commands give up after 20 s: a GPU process that draws for another
 * page is slow.
 */
const TIMEOUT_MS = 10_000;
/** Screenshots that a page waits for. */
const images = new WeakMap();

/** One DevTools session for each page. */
const sessions = new WeakMap();

async function devtools(page, method, parameters) {
  if (!sessions.has(page)) sessions.set(page, await page.context().newCDPSession(page));
  return sessions.get(page).send(method, parameters);
}
