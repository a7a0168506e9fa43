/**
 * `npm run lab -- posters [--only REGEX] [--small FILE.sog] [--out FOLDER]`: the posters of the gallery and of the first page, as the built site draws the first whole frames of its scenes, and the
 * number of splats of each. `tests/site/posters.alone.lab.test.ts` compares them again.
 */
import { copyFileSync, mkdirSync, readFileSync, statSync, writeFileSync } from 'node:fs';
import { join } from 'node:path';
import { parseArgs } from 'node:util';
import { chromium } from 'playwright-core';
import gallery from '../demo/site/data/gallery.mjs';
import { findChromium, SWIFTSHADER_FLAGS } from './lib/chromium.mjs';
import { root } from './lib/run.mjs';
import { serve } from '../packages/cli/src/lib/server.mjs';

/** A poster of the first page is as wide as the scene ever is, and a narrow one is for phones: the angle of view is vertical, so that a part of it is the frame of a narrower scene. */
const OF_HOME = [
  { id: 'home', width: 1408, height: 640 },
  { id: 'home-narrow', width: 640, height: 640 },
];
const OF_GALLERY = { width: 720, height: 480 };
const QUALITY = 0.72;
/** Milliseconds in which models that work in steps show their result. */
const STEPS_MS = 4_000;

/** Versions of one view of the apartment that the first page compares: a held-out image, the trained splats, and a file of fewer bytes (`--small`). */
const VERSIONS = { view: '12', ply: 'version-splats', small: 'version-small', image: 'version-image' };

/** Bytes of a splat of degree 3 in the PLY file of a trainer: 62 numbers. */
const PLY_BYTES = 248;

const OWN = join(root, 'demo/scenes/posters');
const { values } = parseArgs({
  options: { only: { type: 'string', default: '' }, small: { type: 'string' }, out: { type: 'string', default: OWN } },
});
const folder = values.out;
mkdirSync(folder, { recursive: true });
if (folder !== OWN) copyFileSync(join(OWN, 'counts.json'), join(folder, 'counts.json'));
const countsPath = join(folder, 'counts.json');
const server = await serve({ '/': `${root}demo/dist` });
const browser = await chromium.launch({ executablePath: findChromium(), args: SWIFTSHADER_FLAGS });
const wanted = ({ id }) => new RegExp(values.only).test(id);
for (const scene of gallery().filter(wanted)) {
  const splats = await savePosters(`/gallery/${scene.id}/`, [{ id: scene.id, ...OF_GALLERY }]);
  // Other sources have buffers for more splats than a frame shows.
  if (!/\.(spz|sog)$/.test(scene.src)) continue;
  const counts = { ...JSON.parse(readFileSync(countsPath, 'utf8')), [scene.id]: splats };
  writeFileSync(countsPath, `${JSON.stringify(counts, null, 2)}\n`);
}
if (values.small) await saveVersions(values.small);
if (OF_HOME.some(wanted)) await savePosters('/', OF_HOME.filter(wanted));
await browser.close();
server.closeAllConnections();
server.close();

/** Writes the images that the first page compares. `gaussian-splat optimize demo/scenes/studio/apartment.spz --format-only --out small.sog` makes the file. */
async function saveVersions(small) {
  const fixtures = join(root, 'tests/fixtures/studio/apartment');
  const { views } = JSON.parse(readFileSync(join(fixtures, 'views.json'), 'utf8'));
  const { image, width, height, worldToCamera, K } = views.find(({ name }) => name === VERSIONS.view);
  copyFileSync(join(fixtures, 'images', image), join(folder, `${VERSIONS.image}.webp`));
  const fieldOfView = `${2 * Math.atan(height / 2 / K[1][1])}rad`;
  const tab = await browser.newPage({ viewport: { width, height } });
  await tab.route('**/small.sog', (route) => route.fulfill({ path: small }));
  for (const [name, src] of [
    [VERSIONS.ply, 'scenes/studio/apartment.spz'],
    [VERSIONS.small, 'small.sog'],
  ]) {
    await tab.goto(`http://localhost:${server.address().port}/404.html`);
    await tab.setContent(`<script type="module" src="cdn/gaussian-splat.min.js"></script>
      <gaussian-splat src="${src}" alt="" field-of-view="${fieldOfView}" style="width: ${width}px; height: ${height}px"></gaussian-splat>`);
    await tab.waitForFunction(isSettled, undefined, { timeout: 300_000, polling: 250 });
    const scene = tab.locator('gaussian-splat');
    await scene.evaluate((element, view) => element.flyTo(view, { duration: 0 }), { worldToCamera, K, height });
    await saveImage(scene, { id: name, width, height });
  }
  const splats = await tab.locator('gaussian-splat').evaluate((element) => element.stats.splats);
  const bytes = { ply: PLY_BYTES * splats, small: statSync(small).size };
  writeFileSync(join(folder, 'versions.json'), `${JSON.stringify(bytes, null, 2)}\n`);
  await tab.close();
}

/** Writes images of the first scene of a page; returns the number of its splats. */
async function savePosters(url, sizes) {
  const tab = await browser.newPage({ viewport: { width: 960, height: 800 }, reducedMotion: 'reduce' });
  // Walkers stand on the floor as soon as its map is known, which may be some centimeters off the view.
  await tab.route('**/*.floor', () => undefined);
  await tab.goto(`http://localhost:${server.address().port}${url}`);
  await tab.waitForFunction(() => document.querySelector('gaussian-splat')?.matches(':defined'));
  await tab.evaluate(() => document.querySelector('gaussian-splat').dismissPoster());
  await tab.waitForFunction(isSettled, undefined, { timeout: 300_000, polling: 250 });
  // Models that work in steps show the first ones before the last.
  await tab.waitForTimeout(STEPS_MS);
  const scene = tab.locator('gaussian-splat').first();
  for (const size of sizes) await saveImage(scene, size);
  const splats = await scene.evaluate((element) => element.stats.splats);
  await tab.close();
  return splats;
}

async function saveImage(scene, { id, ...size }) {
  const options = { ...size, mimeType: 'image/webp', qualityArgument: QUALITY };
  const bytes = await scene.evaluate(async (element, each) => {
    const blob = await element.toBlob(each);
    return [...new Uint8Array(await blob.arrayBuffer())];
  }, options);
  writeFileSync(join(folder, `${id}.webp`), Uint8Array.from(bytes));
  console.log(`${id}: ${size.width} x ${size.height}, ${bytes.length} bytes`);
}

function isSettled() {
  const { loaded, revealed, error, stats } = document.querySelector('gaussian-splat');
  if (error) throw new Error(error.message);
  const isWhole = ({ coming, limit }) => coming === 0 && limit !== 'transit';
  return loaded && revealed && stats.streamed.every(isWhole);
}
