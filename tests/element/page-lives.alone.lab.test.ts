/**
 * Lives of whole pages: they enter the back-forward cache and return, and their storage is full. The CDN build
 * must be there: `npm run build -- --element`.
 * SECURITY.md: "The page keeps working".
 */
import assert from 'node:assert/strict';
import { createServer, type Server, type ServerResponse } from 'node:http';
import { readFileSync } from 'node:fs';
import { extname, join } from 'node:path';
import { after, before, test } from 'node:test';
import { fileURLToPath } from 'node:url';
import { chromium, type Browser, type Page } from 'playwright-core';
import type { GaussianSplatElement } from '@gaussian-splat/element';
import { clipOf } from '../support/clips.js';
import { smallCloud } from '../formats/support/small-cloud.js';

const root = fileURLToPath(new URL('../../', import.meta.url));
const { findChromium, SWIFTSHADER_FLAGS } = (await import(
  new URL('../../scripts/lib/chromium.mjs', import.meta.url).href
)) as { findChromium: () => string; SWIFTSHADER_FLAGS: string[] };

const TYPES: Readonly<Record<string, string>> = { '.js': 'text/javascript', '.html': 'text/html', '.css': 'text/css' };
const html = (body: string): string => `<!doctype html><title>Lives</title>
<style>gaussian-splat { display: block; width: 160px; height: 120px }</style>${body}
<script type="module" src="/cdn/gaussian-splat.min.js"></script>
<script>
  addEventListener('pageshow', ({ persisted }) => (window.wasPersisted = persisted));
  addEventListener('pagehide', () => (window.wasPersisted = undefined));
</script>`;
const PAGES: Readonly<Record<string, string>> = {
  '/other': '<!doctype html><title>Other</title>',
  '/moving': html(`<gaussian-splat id="clip" src="/a.gsv" loading="eager" autoplay loop></gaussian-splat>
<gaussian-splat id="turning" src="/compass.splat" loading="eager" auto-rotate auto-rotate-delay="0"></gaussian-splat>`),
  '/loading': html('<gaussian-splat id="late" src="/slow.splat" loading="eager"></gaussian-splat>'),
  '/plain': html('<gaussian-splat id="clip" src="/a.gsv" loading="eager" autoplay loop></gaussian-splat>'),
};

let server: Server;
let browser: Browser;
let origin = '';
/** Answers to requests for `/slow.splat`. */
let slow: ServerResponse[] = [];
const compass = readFileSync(`${root}tests/element/browser/fixtures/compass.splat`);

before(async () => {
  const { bytes: clip } = await clipOf((frame) => smallCloud(200, 0, 1 + frame), { frames: 12, framesPerGroup: 4 });
  server = createServer(({ url = '', headers }, response) => {
    const { pathname } = new URL(url, 'http://localhost');
    const page = PAGES[pathname];
    if (page !== undefined) return void response.writeHead(200, { 'Content-Type': 'text/html' }).end(page);
    if (pathname === '/slow.splat') return void slow.push(response);
    if (pathname === '/compass.splat') return void response.end(compass);
    if (pathname === '/a.gsv') {
      const [, first, last] = /^bytes=(\d+)-(\d+)$/.exec(headers.range ?? '') ?? ['', '0', String(clip.length - 1)];
      const part = Buffer.from(clip.subarray(Number(first), Number(last) + 1));
      const range = `bytes ${first}-${Number(first) + part.length - 1}/${clip.length}`;
      return void response.writeHead(206, { 'Content-Range': range }).end(part);
    }
    try {
      const bytes = readFileSync(join(root, 'packages/element', pathname));
      response.writeHead(200, { 'Content-Type': TYPES[extname(pathname)] ?? 'application/octet-stream' }).end(bytes);
    } catch {
      response.writeHead(404).end();
    }
  });
  await new Promise<void>((resolve) => server.listen(0, resolve));
  origin = `http://localhost:${(server.address() as { port: number }).port}`;
  browser = await chromium.launch({
    executablePath: findChromium(),
    args: SWIFTSHADER_FLAGS,
    ignoreDefaultArgs: ['--disable-back-forward-cache'],
  });
});

after(async () => {
  await browser?.close();
  server?.closeAllConnections();
  server?.close();
});

/** Opens a tab, and collects what goes wrong in it. */
async function open(path: string, prepare?: (tab: Page) => Promise<unknown>): Promise<{ tab: Page; faults: string[] }> {
  const tab = await (await browser.newContext()).newPage();
  const faults: string[] = [];
  tab.on('pageerror', ({ message }) => faults.push(message));
  tab.on('console', (message) => {
    const isFault =
      ['error', 'warning'].includes(message.type()) && !/favicon|404|none has started within 2 s/.test(message.text());
    if (isFault) faults.push(`${message.text()} (${message.location().url})`);
  });
  await prepare?.(tab);
  await tab.goto(origin + path);
  return { tab, faults };
}

const until = (tab: Page, expression: string): Promise<unknown> =>
  tab.waitForFunction(expression, undefined, { timeout: 60_000 });
const element = (id: string): string => `document.querySelector('#${id}')`;

/** Returns that are tried when the browser keeps no page for a reason of its own. */
const TRIES = 5;

/**
 * Leaves a tab's page and returns to it, until the browser has kept the page. The browser may decline for lack of memory or time; a reason that the page gives
 * it is a failure at once.
 */
async function leaveAndReturn(tab: Page, isReady: string): Promise<void> {
  const protocol = await tab.context().newCDPSession(tab);
  const reasons: { type: string; reason: string }[] = [];
  protocol.on('Page.backForwardCacheNotUsed', (event) => reasons.push(...event.notRestoredExplanations));
  await protocol.send('Page.enable');
  for (let i = 0; i < TRIES; i++) {
    await tab.goto(`${origin}/other`);
    await tab.goBack({ waitUntil: 'commit' });
    await until(tab, `window.wasPersisted !== undefined && ${isReady}`);
    if (await tab.evaluate('window.wasPersisted')) return protocol.detach();
    // A worker's lock that is asked for while the page is left counts as asked for by another page.
    const ours = reasons.filter(({ type, reason }) => type !== 'Circumstantial' && reason !== 'WebLocksContention');
    assert.deepEqual(ours, [], 'what the page does that forbids to keep it');
  }
  assert.fail(`the page was not kept in ${TRIES} tries: ${reasons.map(({ reason }) => reason).join(', ')}`);
}

test('a page that returns from the back-forward cache moves on: its clip, its rotation, and one canvas of each', async () => {
  const { tab, faults } = await open('/moving');
  const isReady = `${element('clip')}.loaded && ${element('turning')}.loaded && ${element('clip')}.currentTime > 0`;
  await until(tab, isReady);
  for (let round = 0; round < 3; round++) {
    await leaveAndReturn(tab, isReady);
    const turned = `${element('turning')}.getCameraOrbit().theta`;
    const [theta, time] = await tab.evaluate<[number, number]>(`[${turned}, ${element('clip')}.currentTime]`);
    await until(tab, `${turned} !== ${theta} && ${element('clip')}.currentTime !== ${time}`);
  }
  const said = await tab.evaluate((): [boolean, unknown][] =>
    [...document.querySelectorAll<GaussianSplatElement>('gaussian-splat')].map(({ loaded, error }) => [loaded, error]),
  );
  assert.deepEqual(said, [
    [true, null],
    [true, null],
  ]);
  assert.deepEqual(faults, []);
});

test('a page that was left while its scene was loading shows it after its return', async () => {
  slow = [];
  const { tab, faults } = await open('/loading');
  await until(tab, `customElements.get('gaussian-splat') !== undefined`);
  while (slow.length === 0) await tab.waitForTimeout(50);
  await tab.goto(`${origin}/other`);
  await tab.goBack({ waitUntil: 'commit' });
  const answering = setInterval(() => {
    for (const response of slow.splice(0)) response.end(compass);
  }, 100);
  try {
    await until(tab, `${element('late')}?.loaded || ${element('late')}?.error`);
  } finally {
    clearInterval(answering);
  }
  assert.equal(await tab.evaluate(`${element('late')}.error?.message ?? null`), null);
  assert.deepEqual(
    faults.filter((fault) => !/ERR_ABORTED|interrupted|network/i.test(fault)),
    [],
  );
});

test('full storage costs what would be stored, and nothing else', async () => {
  const { tab, faults } = await open('/other', async (page) => {
    await page.addInitScript(() => {
      // Fills the storage of the origin to the last character.
      for (let size = 2 ** 22; size >= 1; size /= 2)
        for (let k = 0; ; k++)
          try {
            localStorage.setItem(`${size}-${k}`, 'a'.repeat(size));
          } catch {
            break;
          }
    });
    const protocol = await page.context().newCDPSession(page);
    await protocol.send('Storage.overrideQuotaForOrigin', { origin, quotaSize: 0 });
  });
  await tab.goto(`${origin}/plain`);
  const isFull = await tab.evaluate(() => {
    try {
      localStorage.setItem('one more', 'a');
      return false;
    } catch {
      return true;
    }
  });
  assert.ok(isFull, 'the storage is full');
  await until(tab, `${element('clip')}.loaded && ${element('clip')}.currentTime > 0`);
  assert.equal(await tab.evaluate(`${element('clip')}.error`), null);
  assert.deepEqual(faults, []);
});
