/** Requirements of every engine on the built element and the site: the checks of `npm run lab -- firefox` and `npm run lab -- webkit`. */
import { mkdirSync, writeFileSync } from 'node:fs';
import { join } from 'node:path';
import { chromium } from 'playwright-core';
import { PNG } from 'pngjs';
import { serve } from '../../packages/cli/src/lib/server.mjs';
import { findChromium, SWIFTSHADER_FLAGS } from '../lib/chromium.mjs';
import { root } from '../lib/run.mjs';

/**
 * Largest allowed difference to Chromium's screenshots: both were rounded to 8 bits twice, by us and by the compositor.
 */
const MIN_DB = 57;
const SIZE = { width: 300, height: 240 };
/** Pages of the site that visitors see first, and those of frameworks. */
const PAGES = ['/', '/gallery/', '/react/', '/vue/'];

/** A check that takes longer has failed, since a page that hangs reports nothing. */
const MAX_MS = 240_000;

/** Frames at rest come within this time, ms. */
const REST_MS = 30_000;

let failures = 0;

export function assert(condition, message) {
  if (!condition) throw new Error(message);
}

export async function check(name, body) {
  const start = performance.now();
  try {
    const late = new Promise((_, reject) => {
      setTimeout(() => reject(new Error(`not done after ${MAX_MS / 1000} s`)), MAX_MS).unref();
    });
    const found = await Promise.race([body(), late]);
    console.log(`ok      ${name}${found ? `: ${found}` : ''} (${Math.round(performance.now() - start)} ms)`);
  } catch (error) {
    failures++;
    console.log(`FAILED  ${name}: ${error.message}`);
  }
}

/** Serves the pages that the checks open. @param uncovered what the checks leave out @param body gets its origin @returns the exit status */
export async function withSite(uncovered, body) {
  const server = await serve({
    '/': join(root, 'demo/dist'),
    '/cdn': join(root, 'packages/element/cdn'),
    '/engines': join(root, 'scripts/engines'),
    '/fixtures': join(root, 'tests/element/browser/fixtures'),
    '/generators': join(root, 'tests/fixtures/generators'),
  });
  try {
    await body(`http://localhost:${server.address().port}`);
  } finally {
    server.closeAllConnections();
    server.close();
  }
  console.log(`Not covered: ${uncovered.join('; ')}.`);
  console.log(failures === 0 ? 'All well.' : `${failures} failed.`);
  return failures === 0 ? 0 : 1;
}

/** Scenes on the screen at rest, against Chromium's images by the same renderer. */
export async function checkScenes(tab, origin, scenes) {
  const expected = await imagesOfChromium(origin, scenes);
  for (const [name, attributes] of Object.entries(scenes)) {
    await check(`${name}, against Chromium`, async () => {
      await tab.evaluate(drawing(attributes));
      const at = performance.now();
      for (;;) {
        const decibels = psnr(await tab.screenshot(SIZE), expected[name]);
        if (decibels >= MIN_DB) return `${decibels.toFixed(1)} dB`;
        // A busy machine comes to rest late.
        const isLate = performance.now() - at > REST_MS;
        assert(!isLate, `${decibels.toFixed(1)} dB, expected at least ${MIN_DB}`);
        await new Promise((resolve) => setTimeout(resolve, 1000));
      }
    });
  }
}

/** Labels, poster, roles and what `positionFromPoint()` finds, by one renderer. */
export async function checkParts(tab, renderer) {
  const still = {
    src: '/fixtures/compass.ply',
    renderer,
    'camera-orbit': '0deg 90deg 8m',
    'interaction-prompt': 'none',
  };
  const shown = (more = {}) => `await show(${JSON.stringify({ ...still, ...more })})`;
  const found = async (body) =>
    JSON.parse(await tab.evaluate(`(async () => JSON.stringify(await (async () => { ${body} })()))()`));
  await check(`the renderer is ${renderer}`, async () => {
    const name = await found(`${shown()}; return element.stats.renderer;`);
    assert(name === renderer, name);
  });
  await check('labels: one in front is visible, one behind is not', async () => {
    await found(`${shown()};
      element.innerHTML = '<button slot="hotspot-a" data-position="0 0 1">a</button><button slot="hotspot-b" data-position="0 0 -1">b</button>';
      await until(() => element.queryHotspot('hotspot-a')?.visible === true, 'the label in front');
      await until(() => element.queryHotspot('hotspot-b')?.visible === false, 'the label behind');
      return true;`);
  });
  await check('a poster covers the scene until it is dismissed', async () => {
    const covered =
      await found(`const coming = show(${JSON.stringify({ ...still, poster: '/scenes/skull-poster.webp', reveal: 'manual', loading: 'eager' })});
      await coming;
      const before = [element.revealed, element.shadowRoot.querySelector('[part=poster]').naturalWidth > 0];
      element.shadowRoot.querySelector('[part=poster-button]').click();
      await until(() => element.revealed, 'the scene');
      return [...before, element.loaded];`);
    assert(covered.join() === 'false,true,true', `revealed, poster, loaded: ${covered}`);
  });
  await check('roles and names', async () => {
    const roles = await found(`${shown({ 'camera-controls': '', alt: 'Compass' })};
      const view = element.shadowRoot.querySelector('#view');
      return [view.getAttribute('role'), view.getAttribute('aria-label'), view.tabIndex, element.shadowRoot.querySelector('[role=status]') !== null];`);
    assert(roles.join() === 'application,Compass,0,true', roles.join());
  });
  await check('positionFromPoint(), as it is and turned by CSS', async () => {
    // Rotated about its middle, the element's right is below: so the ball at x = 1 is below.
    const points = await found(`${shown()};
      const { left, top, width, height } = element.getBoundingClientRect();
      const [x, y] = [left + width / 2, top + height / 2];
      const focal = height / 2 / Math.tan(element.getFieldOfView().radians / 2);
      const away = focal / element.getCameraOrbit().radius;
      const upright = await element.positionFromPoint(x + away, y);
      element.style.transform = 'rotate(90deg)';
      await frames(3);
      const turned = await element.positionFromPoint(x, y + away);
      return [upright?.x, turned?.x];`);
    assert(
      points.every((x) => Math.abs(x - 1) < 0.05),
      `x ${points.join(', ')}, expected 1`,
    );
  });
  const covered = { ...still, poster: '/scenes/skull-poster.webp', reveal: 'manual', loading: 'eager' };
  const ways = {
    'dismissPoster()': [covered, 'element.dismissPoster();'],
    'a click on the poster': [covered, `element.shadowRoot.querySelector('[part=poster-button]').click();`],
    'showPoster() and back': [
      { ...still, poster: covered.poster },
      'element.showPoster(); await delay(1000); element.dismissPoster();',
    ],
    'being shown after it was hidden': [{ ...still, hidden: '', loading: 'eager' }, 'element.hidden = false;'],
  };
  for (const [name, [attributes, act]] of Object.entries(ways)) {
    await check(`the screen has the scene after ${name}`, async () => {
      await found(`await show(${JSON.stringify(attributes)}); ${act} return true;`);
      return checkPainted(tab);
    });
  }
}

/** The screen shows a scene, at the latest when a busy machine has drawn it. Returns the painted fraction in percent. */
export async function checkPainted(tab) {
  const at = performance.now();
  for (;;) {
    await new Promise((resolve) => setTimeout(resolve, 1000));
    const share = paintedShare(await tab.screenshot(SIZE));
    if (share > 0.001) return `${(100 * share).toFixed(1)} % painted`;
    assert(performance.now() - at < REST_MS, 'the screen stays blank');
  }
}

/** Mouse, wheel, keys and fingers, as the browser makes them. */
export async function checkHands(tab, { renderer, hasTouch = true }) {
  const start = () =>
    tab.evaluate(
      `show({ src: '/fixtures/compass.ply', renderer: '${renderer}', 'camera-controls': '', zoom: 'always', 'camera-orbit': '0deg 90deg 8m', 'interaction-prompt': 'none' })
        .then(() => frames(3))`,
    );
  const placed = async () => JSON.parse(await tab.evaluate('place()'));
  const mouse = (...actions) => tab.perform({ type: 'pointer', id: 'mouse', actions });
  const move = (x, y) => ({ type: 'pointerMove', x, y });
  const down = { type: 'pointerDown', button: 0 };
  const up = { type: 'pointerUp', button: 0 };
  await check('a drag orbits', async () => {
    await start();
    await mouse(move(150, 120), down, move(120, 120), move(90, 120), up);
    const [theta] = await placed();
    assert(Math.abs(theta - 90) < 1, `theta ${theta}, expected 90`);
  });
  await check('the wheel zooms', async () => {
    await start();
    const scroll = { type: 'scroll', x: 150, y: 120, deltaX: 0, deltaY: -120 };
    await tab.perform({ type: 'wheel', id: 'wheel', actions: [scroll] });
    const [, , radius] = await placed();
    assert(radius < 7.5, `radius ${radius}`);
  });
  await check('arrow keys turn', async () => {
    await start();
    await tab.evaluate('element.focus()');
    const press = (value) => [
      { type: 'keyDown', value },
      { type: 'keyUp', value },
    ];
    await tab.perform({ type: 'key', id: 'keys', actions: press('\uE014') });
    const [theta] = await placed();
    assert(Math.abs(theta - 22.5) < 1e-6, `theta ${theta}, expected 22.5`);
  });
  if (!hasTouch) return;
  await check('a finger drags, and a double tap picks', async () => {
    await start();
    const touch = (...actions) =>
      tab.perform({ type: 'pointer', id: 'finger', parameters: { pointerType: 'touch' }, actions });
    await touch(move(150, 120), down, move(140, 120), move(110, 120), up);
    const [theta] = await placed();
    assert(Math.abs(theta - 45) < 1, `theta ${theta} after a drag, expected 45`);
    await start();
    const [x, y] = JSON.parse(
      await tab.evaluate(`(async () => {
        for (let x = 155; x < 300; x += 5) {
          const point = await element.positionFromPoint(x, 120);
          if (point && point.x > 0.9) return JSON.stringify([x, 120]);
        }
        throw new Error('no ball on the right');
      })()`),
    );
    const pause = { type: 'pause', duration: 60 };
    await touch(move(x, y), down, pause, up, pause, down, pause, up);
    await tab.evaluate(`until(() => element.getCameraTarget().x > 0.9, 'the target')`);
  });
}

/** A restored WebGL context draws the same image. */
export async function checkLostContext(tab) {
  await check('a lost context: restored with the same frame', async () => {
    const isSame = await tab.evaluate(`(async () => {
      await show({ src: '/fixtures/compass.ply', renderer: 'webgl' });
      const before = element.toDataURL();
      // The event must come from this element: one that was just removed gets the loss, too.
      const restored = new Promise((resolve) => element.addEventListener('contextrestored', resolve, { once: true }));
      contexts.at(-1).getExtension('WEBGL_lose_context').loseContext();
      await restored;
      return before === element.toDataURL();
    })()`);
    assert(isSame, 'another frame');
  });
}

/** Pages of the site: every visible scene loads and paints. Screenshots stay in `.cache/engines` for inspection. */
export async function checkPages(tab, engine) {
  const folder = join(root, '.cache/engines', engine);
  mkdirSync(folder, { recursive: true });
  for (const page of PAGES)
    await check(`the page ${page}`, async () => {
      await tab.open(page);
      await tab.evaluate(`import('/engines/page.js')`);
      const reported = await tab.evaluate('scenesOfPage()');
      const image = await tab.screenshot({ width: 1000, height: 700 });
      writeFileSync(join(folder, `${page.replaceAll('/', '') || 'home'}.png`), image);
      assert(/^\d+ scenes/.test(reported) && !reported.startsWith('0'), reported);
      return reported;
    });
}

export async function checkThrown(tab) {
  await check('nothing was thrown', async () => {
    // The server of another origin is closed after its check, although pages may still prefetch from it.
    const thrown = (await tab.takeExceptions()).filter((text) => !/CORS request did not succeed/.test(text));
    assert(thrown.length === 0, thrown.join('; '));
  });
}

/** An expression that shows a scene, then waits for later events. */
function drawing(attributes) {
  const rest = attributes.postprocess || attributes.detail ? 6000 : 1500;
  return `show(${JSON.stringify({ ...attributes, loading: 'eager' })}).then(() => delay(${rest}))`;
}

async function imagesOfChromium(origin, scenes) {
  const browser = await chromium.launch({ executablePath: findChromium(), args: SWIFTSHADER_FLAGS });
  try {
    const page = await browser.newPage();
    await page.goto(`${origin}/engines/page.html`);
    const images = {};
    for (const [name, attributes] of Object.entries(scenes)) {
      await page.evaluate(drawing(attributes));
      images[name] = await page.screenshot({ clip: { x: 0, y: 0, ...SIZE } });
    }
    return images;
  } finally {
    await browser.close();
  }
}

/** The upper left corner of an image, as red, green and blue. */
function cornerOf(bytes, size = SIZE) {
  const { width, data } = PNG.sync.read(bytes);
  const colors = new Uint8Array(3 * size.width * size.height);
  for (let y = 0, to = 0; y < size.height; y++)
    for (let x = 0; x < size.width; x++) for (let c = 0; c < 3; c++) colors[to++] = data[4 * (y * width + x) + c];
  return colors;
}

/** Fraction of the values in the upper left corner of an image that are not white. */
export function paintedShare(bytes, size = SIZE) {
  const colors = cornerOf(bytes, size);
  return colors.reduce((sum, value) => sum + (value < 200 ? 1 : 0), 0) / colors.length;
}

/** Differences between the colors of two PNG files. Images that show nothing are refused. */
function psnr(a, b) {
  const [found, expected] = [a, b].map((bytes) => cornerOf(bytes));
  assert(paintedShare(b) > 500 / expected.length, 'an empty frame');
  const sum = found.reduce((total, value, i) => total + (value - expected[i]) ** 2, 0);
  return sum === 0 ? Infinity : 10 * Math.log10((255 ** 2 * found.length) / sum);
}
