/**
 * `npm run lab -- webgl [--firefox PATH] [--chromium-only]`: the WebGL renderer in Chromium and in Firefox (Debian's firefox-esr, or another by its path), on the reference views
 * against the float64 oracle; the element without WebGPU; how old orders are while the camera moves; bytes of code. After `npm run build`. Not part of `npm test`.
 */
import { readdirSync, readFileSync } from 'node:fs';
import { join } from 'node:path';
import { parseArgs } from 'node:util';
import { gzipSync } from 'node:zlib';
import { chromium } from 'playwright-core';
import { readScene } from '@gaussian-splat/formats';
import { findChromium, SWIFTSHADER_FLAGS } from './lib/chromium.mjs';
import { FirefoxTab, launchFirefox, withDisplay } from './lib/firefox.mjs';
import { root } from './lib/run.mjs';
import { renderOracle, toRgba } from '../tests/oracle/oracle.js';
import { referenceViews } from '../tests/support/cameras.js';
import { hasSharedData, sharedFile } from '../tests/support/data.js';
import { psnr } from '../tests/support/metrics.js';
import { serve } from '../packages/cli/src/lib/server.mjs';

const { values } = parseArgs({
  options: { firefox: { type: 'string', default: 'firefox-esr' }, 'chromium-only': { type: 'boolean' } },
});
const MIN_DB = 45;
const MAX_AGE_MS = 100;
const MAX_BYTES = 30_000;
const MODES = ['classic', 'antialiased'];

const server = await serve({
  '/': join(root, 'demo/dist'),
  '/cdn': join(root, 'packages/element/cdn'),
  '/packages': join(root, 'packages'),
  '/node_modules': join(root, 'node_modules'),
  '/engines': join(root, 'scripts/engines'),
  '/fixtures': join(root, 'tests/element/browser/fixtures'),
  '/generators': join(root, 'tests/fixtures/generators'),
  ...(hasSharedData ? { '/shared': join(root, '../shared/data') } : {}),
});
const origin = `http://localhost:${server.address().port}`;
const oracles = await oraclesOf();
let failures = 0;

await inChromium((evaluate, version) => checkAll(`Chromium ${version} (SwiftShader)`, evaluate));
if (!values['chromium-only'])
  await withDisplay((env) => inFirefox((evaluate, version) => checkAll(`Firefox ${version}`, evaluate), env));
check('bytes of code', `${bytesOfCode()} bytes of gzip`, bytesOfCode() <= MAX_BYTES);
server.closeAllConnections();
server.close();
console.log(failures === 0 ? 'All well.' : `${failures} failed.`);
process.exit(failures === 0 ? 0 : 1);

function check(name, found, isRight) {
  if (!isRight) failures++;
  console.log(`${isRight ? 'ok     ' : 'FAILED '} ${name}: ${found}`);
}

/** Reference images of the reference views, each in one mode as in `npm test`. */
async function oraclesOf() {
  if (!hasSharedData) return [];
  const known = new Map();
  const images = [];
  for (const [i, view] of referenceViews().entries()) {
    if (!known.has(view.file)) known.set(view.file, await readScene(sharedFile(view.file), { name: view.file }));
    const mode = MODES[i % 2];
    images.push({ view, mode, oracle: renderOracle(known.get(view.file), view.camera, { rules: 'gsplat', mode }) });
  }
  return images;
}

async function checkAll(browser, evaluate) {
  console.log(browser);
  // Formats in which the element blends; float16 for the first view, too.
  const drawn = [...oracles.slice(0, 1).map((first) => ({ ...first, wanted: 'rgba16float' })), ...oracles];
  for (const { view, mode, oracle, wanted = 'rgba32float' } of drawn) {
    const request = [`/shared/${view.file}`, view.camera, mode, wanted].map((part) => JSON.stringify(part));
    const { pixels, format, frameMs, sortMs } = JSON.parse(await evaluate(`drawView(${request.join()})`));
    const found = Float32Array.from(Buffer.from(pixels, 'base64'), (byte) => byte / 255);
    const decibels = psnr(found, toRgba(oracle), { mask: oracle.contributors, channels: 4, clamp: true });
    const times = `frame ${frameMs.toFixed(0)} ms, sort ${sortMs.toFixed(1)} ms`;
    check(`${view.name} ${mode}`, `${decibels.toFixed(1)} dB, ${format}, ${times}`, decibels >= MIN_DB);
  }
  const reported = await evaluate(
    `show({ src: '/scenes/skull.spz', 'camera-controls': '' }).then((element) => JSON.stringify([element.stats.renderer, element.loaded, !!navigator.gpu]))`,
  );
  const [renderer, isLoaded, hasWebGpu] = JSON.parse(reported);
  check('the element chooses automatically', reported, isLoaded && renderer === (hasWebGpu ? 'webgpu' : 'webgl'));
  const ages = JSON.parse(await evaluate(`orderAges({ src: '/scenes/skull.spz', renderer: 'webgl' }, 6000)`));
  const rates = `${ages.perSecond.toFixed(0)} frames a second with ${ages.moving}`;
  check(
    `orders in motion, ${ages.splats} splats`,
    `median ${ages.median.toFixed(0)} ms, at most ${ages.most.toFixed(0)} ms old (${ages.frames} frames); ${rates}`,
    ages.most <= MAX_AGE_MS,
  );
}

async function inChromium(body) {
  const browser = await chromium.launch({ executablePath: findChromium(), args: SWIFTSHADER_FLAGS });
  try {
    const page = await browser.newPage();
    await page.goto(`${origin}/engines/webgl.html`);
    await page.waitForFunction('window.isReady');
    await body((expression) => page.evaluate(expression), browser.version());
  } finally {
    await browser.close();
  }
}

/** In a window: without a display it has no WebGL. */
async function inFirefox(body, env) {
  const firefox = await launchFirefox({ executable: values.firefox, env, isHeadless: false });
  try {
    const tab = new FirefoxTab(firefox, origin);
    await tab.open('/engines/webgl.html');
    await tab.evaluate(`until(() => window.isReady, 'the page')`);
    await body((expression) => tab.evaluate(expression), firefox.version);
    const thrown = tab.takeExceptions();
    check('nothing was thrown', thrown.join('; ') || 'nothing', thrown.length === 0);
  } finally {
    await firefox.close();
  }
}

/** Chunks that only pages with WebGL fetch: those of its renderer and its sort. */
function bytesOfCode() {
  const cdn = join(root, 'packages/element/cdn');
  const files = readdirSync(cdn, { recursive: true }).filter((file) => file.endsWith('.js'));
  // three.js draws with WebGL, too: by what only this renderer has.
  const isOfWebGl = (text) => /t_geometry|unsupported\/webgl/.test(text);
  return files
    .map((file) => [file, readFileSync(join(cdn, file))])
    .filter(([file, code]) => isOfWebGl(code.toString()) || /sort-splats/.test(file))
    .reduce((sum, [, code]) => sum + gzipSync(code, { level: 9 }).length, 0);
}
