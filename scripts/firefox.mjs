/**
 * `npm run lab:firefox [-- --firefox PATH]`: the built element and site in Firefox (Debian's firefox-esr, or another by its path). First as it comes: where it has no
 * WebGPU (Linux), every page must live on without. Then with WebGPU switched on (`dom.webgpu.enabled`; without a GPU that is Mesa's lavapipe, package
 * mesa-vulkan-drivers), against pictures of Chromium. After `npm run build`. Not part of `npm test`.
 */
import { readFileSync } from 'node:fs';
import { join } from 'node:path';
import { parseArgs } from 'node:util';
import { chromium } from 'playwright-core';
import { PNG } from 'pngjs';
import { findChromium, SWIFTSHADER_FLAGS } from './lib/chromium.mjs';
import { FirefoxTab, launchFirefox } from './lib/firefox.mjs';
import { root } from './lib/run.mjs';
import { serve } from '../packages/cli/src/lib/server.mjs';

const { values } = parseArgs({ options: { firefox: { type: 'string', default: 'firefox-esr' } } });
const WEBGPU = { 'dom.webgpu.enabled': true, 'gfx.webgpu.ignore-blocklist': true };
/** What pictures on the screen may differ by from Chromium's: both have been rounded to 8 bits twice, by us and by the compositor. */
const LEAST_DB = 57;
/** Not understood yet: held where they are, so that they get no worse unseen. */
const KNOWN_GAPS = { 'the skull that ships': 49, 'levels of detail': 49 };
const SIZE = { width: 300, height: 240 };
const SCENES = {
  'a PLY': { src: '/fixtures/compass.ply' },
  'the skull that ships': { src: '/scenes/skull.spz' },
  'a generator': { src: '/generators/packed.onnx' },
  'levels of detail': { src: '/scenes/skull.spz', detail: '2px' },
  'a post-processor': { src: '/scenes/skull.spz', postprocess: '/generators/post.onnx', 'control-gain': '0.2' },
};

const server = await serve({
  '/': join(root, 'demo/dist'),
  '/cdn': join(root, 'packages/element/cdn'),
  '/firefox': join(root, 'scripts/firefox'),
  '/fixtures': join(root, 'tests/element/browser/fixtures'),
  '/generators': join(root, 'tests/fixtures/generators'),
});
const origin = `http://localhost:${server.address().port}`;
let failures = 0;

await withFirefox({}, checkWithoutWebGpu);
await withFirefox(WEBGPU, checkWithWebGpu);
// In a browser of its own, and a while after the picture was read: Firefox 153 does not draw again with another device when the first is destroyed right after that.
await withFirefox(WEBGPU, checkRecovery);
server.closeAllConnections();
server.close();
console.log(failures === 0 ? 'All well.' : `${failures} failed.`);
process.exit(failures === 0 ? 0 : 1);

async function withFirefox(preferences, body) {
  const firefox = await launchFirefox({ executable: values.firefox, preferences });
  try {
    await body(new FirefoxTab(firefox, origin), firefox.version);
  } finally {
    await firefox.close();
  }
}

async function check(name, body) {
  const start = performance.now();
  try {
    const found = await body();
    console.log(`ok      ${name}${found ? `: ${found}` : ''} (${Math.round(performance.now() - start)} ms)`);
  } catch (error) {
    failures++;
    console.log(`FAILED  ${name}: ${error.message}`);
  }
}

function assert(condition, message) {
  if (!condition) throw new Error(message);
}

async function checkWithoutWebGpu(tab, version) {
  await tab.open('/firefox/page.html');
  if (await tab.evaluate('!!navigator.gpu')) return console.log(`Firefox ${version} has WebGPU as it comes.`);
  console.log(`Firefox ${version} as it comes, without WebGPU`);
  await check('the element says so, keeps its poster, and fetches neither scene nor worker', async () => {
    const found = await tab.evaluate(`(async () => {
      const reason = await show({ src: '/scenes/skull.spz', poster: '/scenes/skull-poster.webp', 'camera-controls': '' }).catch(() => 'refused');
      const element = document.querySelector('gaussian-splat');
      const part = (name) => element.shadowRoot.querySelector('[part=' + name + ']').getBoundingClientRect();
      const fetched = performance.getEntriesByType('resource').map(({ name }) => name).filter((name) => /spz|worker|readers/.test(name));
      return JSON.stringify([reason, element.error.reason, part('fallback').height > 20, part('poster').width, fetched]);
    })()`);
    assert(found === JSON.stringify(['refused', 'unsupported/no-webgpu', true, 300, []]), found);
  });
  const pages = JSON.parse(readFileSync(join(root, 'demo/dist/pages.json'), 'utf8'));
  await check(
    `${pages.length} pages of the site load, upgrade, do not scroll sideways, and throw nothing`,
    async () => {
      const faults = [];
      for (const page of pages) {
        await tab.open(page);
        const found = await tab.evaluate(`(async () => {
        await new Promise((resolve) => setTimeout(resolve, 150));
        const elements = [...document.querySelectorAll('gaussian-splat')];
        await Promise.all(elements.filter(({ loading }) => loading === 'eager').map(({ ready }) => ready));
        const odd = elements.filter((element) => !element.matches(':defined') || (element.error && element.error.code !== 'unsupported'));
        const wide = document.documentElement.scrollWidth - document.documentElement.clientWidth;
        return [odd.length && odd.length + ' odd elements', wide > 0 && wide + ' px too wide'].filter(Boolean).join(', ');
      })()`);
        const thrown = tab.takeExceptions();
        if (found || thrown.length > 0) faults.push(`${page}: ${[found, ...thrown].filter(Boolean).join(', ')}`);
      }
      assert(faults.length === 0, faults.join('\n        '));
    },
  );
}

async function checkWithWebGpu(tab, version) {
  await tab.open('/firefox/page.html');
  const features = await tab.evaluate(`navigator.gpu?.requestAdapter().then((a) => a && [...a.features].join(', '))`);
  if (!features)
    return check(`Firefox ${version} with WebGPU`, () =>
      assert(false, 'no adapter: apt-get install mesa-vulkan-drivers'),
    );
  const build = await tab.evaluate(`'Suspending' in WebAssembly ? 'JSPI' : 'no JSPI'`);
  console.log(`Firefox ${version} with WebGPU: ${features}; ${build}`);
  const expected = await picturesOfChromium();
  for (const [name, attributes] of Object.entries(SCENES)) {
    await check(`${name}, against Chromium`, async () => {
      await tab.evaluate(drawing(attributes));
      const decibels = psnr(await tab.screenshot(SIZE), expected[name]);
      const least = KNOWN_GAPS[name] ?? LEAST_DB;
      assert(decibels >= least, `${decibels.toFixed(1)} dB, expected at least ${least}`);
      return `${decibels.toFixed(1)} dB`;
    });
  }
  await check('what moves: play, seek', async () => {
    await tab.evaluate(`(async () => {
      await show({ src: '/generators/packed.onnx' });
      await element.play();
      await until(() => element.currentTime > 0.2, 'the time to run');
      element.pause();
      element.currentTime = 1.5;
      await until(() => told.includes('seeked'), 'the frame');
    })()`);
  });
  await check('float16 in a generator', async () =>
    tab.evaluate(`show({ src: '/generators/packed-sh-half.onnx' }).then(() => told.join('; ') || 'on the GPU')`),
  );
  await checkHands(tab);
  await check('nothing was thrown', () => {
    const thrown = tab.takeExceptions();
    assert(thrown.length === 0, thrown.join('; '));
  });
}

async function checkRecovery(tab) {
  await check('a lost device: back with the same picture', async () => {
    await tab.open('/firefox/page.html');
    const same = await tab.evaluate(`(async () => {
      await show({ src: '/fixtures/compass.ply' });
      const before = element.toDataURL();
      await delay(2000);
      const { sharedDevice } = element.constructor;
      const lease = await sharedDevice.acquire();
      lease.device.destroy();
      lease.release();
      await until(() => told.includes('contextrestored'), 'the scene');
      return [told.join(), before === element.toDataURL()].join();
    })()`);
    assert(same === 'contextlost,contextrestored,true', same);
  });
}

/** Mouse, wheel, keys and fingers, as the browser makes them. */
async function checkHands(tab) {
  const start = (more = '') =>
    tab.evaluate(
      `show({ src: '/fixtures/compass.ply', 'camera-controls': '', 'camera-orbit': '0deg 90deg 8m', 'interaction-prompt': 'none' ${more} })
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
    await tab.perform({
      type: 'wheel',
      id: 'wheel',
      actions: [{ type: 'scroll', x: 150, y: 120, deltaX: 0, deltaY: -120 }],
    });
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

/** An expression that shows a scene, and waits a while for what comes after it. */
function drawing(attributes) {
  const rest = attributes.postprocess || attributes.detail ? 6000 : 1500;
  return `show(${JSON.stringify({ ...attributes, loading: 'eager' })}).then(() => delay(${rest}))`;
}

async function picturesOfChromium() {
  const browser = await chromium.launch({ executablePath: findChromium(), args: SWIFTSHADER_FLAGS });
  try {
    const page = await browser.newPage();
    await page.goto(`${origin}/firefox/page.html`);
    const pictures = {};
    for (const [name, attributes] of Object.entries(SCENES)) {
      await page.evaluate(drawing(attributes));
      pictures[name] = await page.screenshot({ clip: { x: 0, y: 0, ...SIZE } });
    }
    return pictures;
  } finally {
    await browser.close();
  }
}

/** Of two PNG, over their colours; pictures that show nothing are refused. */
function psnr(a, b) {
  const [found, expected] = [a, b].map((bytes) => PNG.sync.read(bytes).data);
  assert(found.length === expected.length, `${found.length / 4} pixels`);
  assert(expected.filter((value) => value < 200).length > 500, 'an empty picture');
  const sum = found.reduce((total, value, i) => total + (value - expected[i]) ** 2, 0);
  return sum === 0 ? Infinity : 10 * Math.log10((255 ** 2 * found.length) / sum);
}
