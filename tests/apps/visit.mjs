/** Opens an app in Chromium as a visitor: are its scene and a generator visible, with a worker and a clean console, and how many bytes of code did the server send for it? */
import { cpSync, existsSync, readFileSync, writeFileSync } from 'node:fs';
import { createRequire } from 'node:module';
import { basename, dirname, join } from 'node:path';
import { setTimeout } from 'node:timers/promises';
import { gzipSync } from 'node:zlib';
import { chromium } from 'playwright-core';
import { RUNTIME_FILES } from '@gaussian-splat/generator';
import { findChromium, gpuFlags } from '../../scripts/lib/chromium.mjs';
import { serve } from '../../packages/cli/src/lib/server.mjs';

const root = new URL('../../', import.meta.url);
const CORS = { 'access-control-allow-origin': '*' };
/** Advice of the element about the scene, whose writer names no axes. It says nothing about the app. */
const ABOUT_THE_FILE = /does not name its axes/;
/** A development server may have to bundle first. */
const MAX_MS = 120_000;
/** Time without a request after which a page has loaded all that needs no visitor. */
const QUIET_MS = 1_500;
/** The event `load` follows the first image, whose code for motion may be requested before it. */
const EVENT_MS = 50;
const CODE = /\.(js|mjs|css)$/;

/**
 * @param {{ folder?: string, elsewhere?: string, address?: string, faults?: RegExp, hasGenerator?: boolean }} app a folder to serve, with another one at another origin, whose address takes the
 *   place of `ELSEWHERE` in the page; or the address of a page; its allowed console messages; and whether the folder's code also shows a generator
 * @returns {Promise<{ code: Code, workers: number, painted: number, generated?: number }>} what the server sent, the workers, and the fraction of the element's pixels that the scene and the generator paint
 *
 * @typedef {object} Code Scripts and styles of a folder, as often as they were requested
 * @property {number} first bytes of gzip until the scene was visible
 * @property {number} late bytes of gzip after that
 * @property {{ name: string, gzip: number, isLate: boolean }[]} scripts
 */
export async function visitApp({ folder, elsewhere, address, faults, hasGenerator }) {
  const other = elsewhere && existsSync(elsewhere) ? await serve({ '/': elsewhere }, { headers: CORS }) : undefined;
  const own = folder ? await serve({ '/': folder, '/generator/': writeGenerator(folder) }) : undefined;
  const requests = [];
  const record = (server, from) =>
    server?.on('request', ({ url }) =>
      requests.push({ at: Date.now(), file: join(from, new URL(url, 'http://localhost').pathname) }),
    );
  record(own, folder);
  record(other, elsewhere);
  const browser = await chromium.launch({ executablePath: findChromium(), args: gpuFlags() });
  try {
    if (other) replaceElsewhere(folder, `http://127.0.0.1:${other.address().port}`);
    const at = address ?? `http://127.0.0.1:${own.address().port}/`;
    return await visit(await browser.newPage(), requests, faults, at, hasGenerator);
  } finally {
    await browser.close();
    for (const server of [own, other]) {
      server?.closeAllConnections();
      server?.close();
    }
  }
}

function replaceElsewhere(folder, address) {
  const page = join(folder, 'index.html');
  writeFileSync(page, readFileSync(page, 'utf8').replaceAll('ELSEWHERE', address));
}

/** A model and ONNX Runtime, as authors copy them by the guide to their static files. Returns the folder. */
function writeGenerator(folder) {
  const target = join(folder, '../generator-of-app');
  const runtime = dirname(createRequire(import.meta.url).resolve('onnxruntime-web'));
  for (const file of RUNTIME_FILES) cpSync(join(runtime, file), join(target, file));
  cpSync(new URL('tests/fixtures/generators/packed.onnx', root), join(target, 'packed.onnx'));
  return target;
}

async function visit(page, requests, faults, address, hasGenerator) {
  const complaints = [];
  page.on('pageerror', (error) => complaints.push(`error: ${error.message}`));
  page.on('console', (message) => {
    if (
      /^(warning|error)$/.test(message.type()) &&
      !faults?.test(message.text()) &&
      !ABOUT_THE_FILE.test(message.text())
    )
      complaints.push(`${message.type()}: ${message.text()}`);
  });
  let max = 0;
  page.on('worker', () => (max = Math.max(max, page.workers().length)));
  await page.addInitScript(noteLoad);
  await open(page, address);
  const found = await loading(page);
  if (found !== true) throw new Error([`no scene: ${found}`, ...complaints].join('\n'));
  const code = await codeOf(requests, await page.evaluate(() => globalThis.sceneLoadedAt));
  const painted = await page.evaluate(shareOfPaint);
  if (!(painted > 0.05)) throw new Error(`${painted} of the element is painted`);
  const generated = hasGenerator ? await showGenerator(page, complaints) : undefined;
  if (max === 0) complaints.push('there is no worker');
  if (complaints.length > 0) throw new Error(complaints.join('\n'));
  return { code, workers: max, painted, generated };
}

/** In the page: notes when the scene is visible, ms since 1970. */
function noteLoad() {
  const note = ({ target }) => target.localName === 'gaussian-splat' && (globalThis.sceneLoadedAt ??= Date.now());
  document.addEventListener('load', note, true);
}

/** Waits until the page requests nothing more. Returns the code that it has requested: Playwright's responses lack the bytes of some workers. */
async function codeOf(requests, loadedAt) {
  while (requests.length > 0 && Date.now() - requests.at(-1).at < QUIET_MS) await setTimeout(QUIET_MS / 4);
  const scripts = requests
    .filter(({ file }) => CODE.test(file) && existsSync(file))
    .map(({ at, file }) => ({
      name: basename(file),
      gzip: gzipSync(readFileSync(file), { level: 6 }).length,
      isLate: at > loadedAt - EVENT_MS,
    }));
  const sum = (isLate) => scripts.reduce((total, each) => total + (each.isLate === isLate ? each.gzip : 0), 0);
  return { first: sum(false), late: sum(true), scripts };
}

/** Replaces the scene by a generator, with the code of the app. Returns the fraction of the pixels that it paints. */
async function showGenerator(page, complaints) {
  await page.evaluate(() => {
    const element = document.querySelector('gaussian-splat');
    element.constructor.runtimeLocation = '/generator/';
    element.src = '/generator/packed.onnx';
  });
  const found = await loading(page);
  if (found !== true) throw new Error([`no generator: ${found}`, ...complaints].join('\n'));
  const generated = await page.evaluate(shareOfPaint);
  if (!(generated > 0.05)) throw new Error(`${generated} of the element is painted by the generator`);
  return generated;
}

/** Waits for the scene of the page's element. Returns true, or the error. */
const loading = (page) =>
  page
    .waitForFunction(
      () => {
        const { loaded, error } = document.querySelector('gaussian-splat') ?? {};
        return error ? error.message : loaded;
      },
      undefined,
      { timeout: MAX_MS },
    )
    .then(
      (handle) => handle.jsonValue(),
      (error) => error.message.split('\n')[0],
    );

/** A development server takes a while to listen. */
async function open(page, address) {
  for (const end = Date.now() + MAX_MS; ;) {
    try {
      return await page.goto(address, { timeout: MAX_MS });
    } catch (error) {
      // The browser's own page for a server that does not answer yet may come in between.
      if (!/ERR_CONNECTION_REFUSED|chrome-error:/.test(error.message) || Date.now() > end) throw error;
      await setTimeout(300);
    }
  }
}

/** In the page: the fraction of pixels of the element's image that are not transparent. */
async function shareOfPaint() {
  const image = await createImageBitmap(await document.querySelector('gaussian-splat').toBlob());
  const context = new OffscreenCanvas(image.width, image.height).getContext('2d');
  context.drawImage(image, 0, 0);
  const { data } = context.getImageData(0, 0, image.width, image.height);
  let painted = 0;
  for (let i = 3; i < data.length; i += 4) if (data[i] > 127) painted++;
  return painted / (data.length / 4);
}
