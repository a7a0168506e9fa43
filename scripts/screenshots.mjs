/**
 * `npm run lab -- screenshots [--only REGEX] [--out FOLDER] [--scheme light|dark] [--seconds 40] [--widths 390,1280] [--first] [--scenes]`: a screenshot of every page of
 * the built site at 390 and 1280 CSS pixels, for people to look at. Scenes in the first screen get some seconds to appear; SwiftShader is slow. `--scenes` waits for
 * those below it, too; `--first` takes the first screen alone.
 */
import { mkdirSync, readFileSync } from 'node:fs';
import { join } from 'node:path';
import { parseArgs } from 'node:util';
import { chromium } from 'playwright-core';
import { findChromium, SWIFTSHADER_FLAGS } from './lib/chromium.mjs';
import { root } from './lib/run.mjs';
import { serve } from '../packages/cli/src/lib/server.mjs';

/** A screenshot of a whole document would be too tall to look at. */
const MAX_PIXELS_DOWN = 6000;

const { values } = parseArgs({
  options: {
    only: { type: 'string', default: '' },
    out: { type: 'string', default: 'test-output/screenshots' },
    scheme: { type: 'string', default: 'light' },
    seconds: { type: 'string', default: '40' },
    widths: { type: 'string', default: '390,1280' },
    first: { type: 'boolean', default: false },
    scenes: { type: 'boolean', default: false },
  },
});
const pages = JSON.parse(readFileSync(join(root, 'demo/dist/pages.json'), 'utf8')).filter((url) =>
  new RegExp(values.only).test(url),
);
mkdirSync(values.out, { recursive: true });
const server = await serve({ '/': `${root}demo/dist` });
const browser = await chromium.launch({ executablePath: findChromium(), args: SWIFTSHADER_FLAGS });
for (const width of values.widths.split(',').map(Number)) {
  const context = await browser.newContext({ viewport: { width, height: 900 }, colorScheme: values.scheme });
  for (const url of pages) await image(await context.newPage(), url, width);
  await context.close();
}
await browser.close();
server.closeAllConnections();
server.close();

async function image(tab, url, width) {
  await tab.goto(`http://localhost:${server.address().port}${url}`);
  await settle(tab, `${url} at ${width}`);
  if (values.scenes) await visitScenes(tab, `${url} at ${width}`);
  const height = await tab.evaluate(() => document.documentElement.scrollHeight);
  const overflow = await tab.evaluate(() => document.documentElement.scrollWidth - innerWidth);
  if (overflow > 0) console.log(`${url} at ${width}: ${overflow} pixels too wide`);
  const name = `${url.replace(/^\/|\/$|\.html$/g, '').replaceAll('/', '-') || 'index'}-${width}-${values.scheme}.png`;
  const clip = { x: 0, y: 0, width, height: Math.min(height, MAX_PIXELS_DOWN) };
  await tab.screenshot({ path: join(values.out, name), ...(values.first ? {} : { fullPage: true, clip }) });
  await tab.close();
}

async function settle(tab, place) {
  await tab
    .waitForFunction(isSettled, undefined, { timeout: 1000 * Number(values.seconds), polling: 250 })
    .catch(() => console.log(`${place}: not all visible content was loaded`));
}

/** Scrolls to every scene, one after the other: scenes load when they are visible, as all images of the page do. */
async function visitScenes(tab, place) {
  for (const scene of await tab.locator('gaussian-splat:visible').all()) {
    await scene.scrollIntoViewIfNeeded();
    await settle(tab, place);
  }
  await tab.evaluate(() => scrollTo(0, 0));
}

/** Every scene in the first screen is visible, or has failed. */
function isSettled() {
  const inSight = (element) => {
    const { top, bottom, width } = element.getBoundingClientRect();
    return width > 0 && bottom > 0 && top < innerHeight;
  };
  const scenes = [...document.querySelectorAll('gaussian-splat')].filter(inSight);
  return scenes.every(({ loaded, error, reveal }) => loaded || error || reveal === 'manual');
}
