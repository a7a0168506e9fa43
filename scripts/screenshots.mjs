/**
 * `npm run screenshots [-- --only REGEX] [--out FOLDER] [--scheme light|dark] [--seconds 40]`: a picture of every page of the built site at 390
 * and 1280 CSS pixels, for people to look at. Scenes in the first screen get some seconds to appear; SwiftShader is slow.
 */
import { mkdirSync, readFileSync } from 'node:fs';
import { join } from 'node:path';
import { parseArgs } from 'node:util';
import { chromium } from 'playwright-core';
import { findChromium, SWIFTSHADER_FLAGS } from './lib/chromium.mjs';
import { root } from './lib/run.mjs';
import { serve } from './lib/server.mjs';

const WIDTHS = [390, 1280];
/** A picture of a whole document would be too tall to look at. */
const MOST_PIXELS_DOWN = 6000;

const { values } = parseArgs({
  options: {
    only: { type: 'string', default: '' },
    out: { type: 'string', default: 'test-output/screenshots' },
    scheme: { type: 'string', default: 'light' },
    seconds: { type: 'string', default: '40' },
  },
});
const pages = JSON.parse(readFileSync(join(root, 'demo/dist/pages.json'), 'utf8')).filter((url) =>
  new RegExp(values.only).test(url),
);
mkdirSync(values.out, { recursive: true });
const server = await serve({ '/': `${root}demo/dist` });
const browser = await chromium.launch({ executablePath: findChromium(), args: SWIFTSHADER_FLAGS });
for (const width of WIDTHS) {
  const context = await browser.newContext({ viewport: { width, height: 900 }, colorScheme: values.scheme });
  for (const url of pages) await picture(await context.newPage(), url, width);
  await context.close();
}
await browser.close();
server.closeAllConnections();
server.close();

async function picture(tab, url, width) {
  await tab.goto(`http://localhost:${server.address().port}${url}`);
  await tab
    .waitForFunction(isSettled, undefined, { timeout: 1000 * Number(values.seconds), polling: 250 })
    .catch(() => console.log(`${url} at ${width}: not everything in sight was loaded`));
  const height = await tab.evaluate(() => document.documentElement.scrollHeight);
  const overflow = await tab.evaluate(() => document.documentElement.scrollWidth - innerWidth);
  if (overflow > 0) console.log(`${url} at ${width}: ${overflow} pixels too wide`);
  const name = `${url.replace(/^\/|\/$|\.html$/g, '').replaceAll('/', '-') || 'index'}-${width}-${values.scheme}.png`;
  const clip = { x: 0, y: 0, width, height: Math.min(height, MOST_PIXELS_DOWN) };
  await tab.screenshot({ path: join(values.out, name), fullPage: true, clip });
  await tab.close();
}

/** Every scene in the first screen is on show, or has failed. */
function isSettled() {
  const inSight = (element) => {
    const { top, bottom, width } = element.getBoundingClientRect();
    return width > 0 && bottom > 0 && top < innerHeight;
  };
  const scenes = [...document.querySelectorAll('gaussian-splat')].filter(inSight);
  return scenes.every(({ loaded, error }) => loaded || error);
}
