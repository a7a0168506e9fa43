/**
 * `npm run lab -- firefox [--firefox PATH]`: the built element and site in Firefox (Debian's firefox-esr, or another by its path). First without WebGPU and WebGL, when every page must still work; then in a window of Xvfb, with WebGL 2; then with WebGPU switched on (`dom.webgpu.enabled`; without a GPU that is Mesa's lavapipe, package
 * mesa-vulkan-drivers). Screenshots are compared with those of Chromium. After `npm run build`. Not part of `npm test`.
 */
import { readFileSync } from 'node:fs';
import { join } from 'node:path';
import { parseArgs } from 'node:util';
import {
  assert,
  check,
  checkHands,
  checkLostContext,
  checkPages,
  checkPainted,
  checkParts,
  checkScenes,
  checkThrown,
  withSite,
} from './engines/checks.mjs';
import { checkMeshPolicies, checkPolicies } from './engines/policies.mjs';
import { FirefoxTab, launchFirefox, withDisplay } from './lib/firefox.mjs';
import { root } from './lib/run.mjs';

const { values } = parseArgs({ options: { firefox: { type: 'string', default: 'firefox-esr' } } });
const WEBGPU = { 'dom.webgpu.enabled': true, 'gfx.webgpu.ignore-blocklist': true };
const WEBGL_SCENES = {
  'a PLY': { src: '/fixtures/compass.ply', renderer: 'webgl' },
  'the skull that ships': { src: '/scenes/skull.spz', renderer: 'webgl' },
};
const SCENES = {
  'a PLY': { src: '/fixtures/compass.ply' },
  'the skull that ships': { src: '/scenes/skull.spz' },
  'a generator': { src: '/generators/packed.onnx' },
  'levels of detail': { src: '/scenes/skull.spz', detail: '2px' },
  'a post-processor': { src: '/scenes/skull.spz', postprocess: '/generators/post.onnx', 'control-gain': '0.2' },
};

/** Firefox hides the device then: textures have 2048 texels a side at most, and canvases are read as noise. */
const HIDDEN = { 'privacy.resistFingerprinting': true };
const UNCOVERED = [
  'Firefox on Windows, macOS and Android, whose WebGPU is on',
  'a GPU: llvmpipe and lavapipe draw',
  'VR and AR, sound, recording',
];

const status = await withSite(UNCOVERED, async (origin) => {
  await withFirefox(origin, { preferences: { 'webgl.disabled': true } }, checkWithoutWebGpu);
  await withDisplay((env) => withFirefox(origin, { env, isHeadless: false }, checkWithWebGl));
  await withDisplay((env) => withFirefox(origin, { env, isHeadless: false, preferences: HIDDEN }, checkHidden));
  await withFirefox(origin, { preferences: WEBGPU }, checkWithWebGpu);
  // In a browser of its own, and some time after the screenshot: Firefox 153 does not draw again with another device when the first is destroyed right after that.
  await withFirefox(origin, { preferences: WEBGPU }, checkRecovery);
});
process.exit(status);

async function withFirefox(origin, options, body) {
  const firefox = await launchFirefox({ executable: values.firefox, ...options });
  try {
    await body(new FirefoxTab(firefox, origin), firefox.version, origin);
  } finally {
    await firefox.close();
  }
}

async function checkWithWebGl(tab, version, origin) {
  console.log(`Firefox ${version} with WebGL 2`);
  await tab.open('/engines/page.html');
  await checkScenes(tab, origin, WEBGL_SCENES);
  await checkParts(tab, 'webgl');
  await checkHands(tab, { renderer: 'webgl' });
  await checkLostContext(tab);
  await checkPolicies(tab);
  await checkPages(tab, 'firefox');
  await checkThrown(tab);
}

async function checkHidden(tab, version) {
  await tab.open('/engines/page.html');
  const size = await tab.evaluate(
    `(() => { const gl = document.createElement('canvas').getContext('webgl2'); return gl.getParameter(gl.MAX_TEXTURE_SIZE); })()`,
  );
  console.log(`Firefox ${version} with resistFingerprinting: textures of ${size} texels a side`);
  for (const [name, attributes] of Object.entries(WEBGL_SCENES))
    await check(`the screen has ${name}`, async () => {
      await tab.evaluate(`show(${JSON.stringify({ ...attributes, loading: 'eager' })}).then(() => true)`);
      return checkPainted(tab);
    });
}

async function checkWithoutWebGpu(tab, version) {
  await tab.open('/engines/page.html');
  if (await tab.evaluate('!!navigator.gpu')) return console.log(`Firefox ${version} has WebGPU as it comes.`);
  console.log(`Firefox ${version} as it comes, without WebGPU`);
  await check('the element says so, keeps its poster, and fetches neither scene nor worker', async () => {
    const found = await tab.evaluate(`(async () => {
      const reason = await show({ src: '/scenes/skull.spz', poster: '/scenes/skull-poster.webp', 'camera-controls': '' }).catch(() => 'refused');
      const element = document.querySelector('gaussian-splat');
      const part = (name) => element.shadowRoot.querySelector('[part=' + name + ']');
      const fetched = performance.getEntriesByType('resource').map(({ name }) => name).filter((name) => /spz|worker|readers/.test(name));
      return JSON.stringify([reason, element.error.reason, part('poster').getBoundingClientRect().width, fetched]);
    })()`);
    assert(found === JSON.stringify(['refused', 'unsupported/no-webgpu', 300, []]), found);
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
        // Pages of libraries that throw without WebGL say so first.
        const isNamed = await tab.evaluate(`/needs WebGL 2/.test(document.querySelector('#notice')?.textContent)`);
        const thrown = tab.takeExceptions().filter((text) => !(isNamed && /WebGL/.test(text)));
        if (found || thrown.length > 0) faults.push(`${page}: ${[found, ...thrown].filter(Boolean).join(', ')}`);
      }
      assert(faults.length === 0, faults.join('\n        '));
    },
  );
}

async function checkWithWebGpu(tab, version, origin) {
  await tab.open('/engines/page.html');
  const features = await tab.evaluate(`navigator.gpu?.requestAdapter().then((a) => a && [...a.features].join(', '))`);
  if (!features)
    return check(`Firefox ${version} with WebGPU`, () =>
      assert(false, 'no adapter: apt-get install mesa-vulkan-drivers'),
    );
  const build = await tab.evaluate(`'Suspending' in WebAssembly ? 'JSPI' : 'no JSPI'`);
  console.log(`Firefox ${version} with WebGPU: ${features}; ${build}`);
  await checkScenes(tab, origin, SCENES);
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
  await checkParts(tab, 'webgpu');
  await checkHands(tab, { renderer: 'webgpu' });
  await checkMeshPolicies(tab);
  await checkThrown(tab);
}

async function checkRecovery(tab) {
  await check('a lost device: restored with the same frame', async () => {
    await tab.open('/engines/page.html');
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
