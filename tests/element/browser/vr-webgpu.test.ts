/**
 * VR by WebGPU: a fake binding over the emulated headset, and the copy of a WebGPU canvas, each eye against the oracle; and the result if the binding is not granted.
 * SECURITY.md: "The page keeps working".
 */
import '@gaussian-splat/element';
import { executeServerCommand } from '@web/test-runner-commands';
import type { GaussianCloud } from '@gaussian-splat/core';
import type { GaussianSplatElement } from '@gaussian-splat/element';
import { fetchScene, readScene } from '@gaussian-splat/formats';
import { MemoryLedger, Stereo } from '@gaussian-splat/renderer';
import { renderOracle, toRgba } from '../../oracle/oracle.js';
import { detailFolder } from '../../support/detail-folder.js';
import { itInLab, someOf } from '../../support/extent-in-pages.js';
import { psnr } from '../../support/metrics.js';
import { pebbles } from '../../support/scenes/pebbles.js';
import { fakeBinding, type FakeBinding, type Layout } from './support/gpu-binding.js';
import { EYE, headset } from './support/headset.js';
import { assert, assertEqual, claimComing, COMPASS, devices, nextEvent, showLoaded, until } from './support/harness.js';
import { cameraOf } from './support/vr-camera.js';

const STILL = { 'interpolation-decay': '0', 'interaction-prompt': 'none', 'camera-orbit': '30deg 80deg 6m' };
const VR = { vr: '', 'camera-controls': '', ...STILL };
const BACKGROUND = [0.1, 0.1, 0.11, 1];
const MIN_DB = 59;
const LIMIT_MS = 3_000;

const buttonOf = (element: GaussianSplatElement): HTMLButtonElement | null =>
  element.shadowRoot!.querySelector('[part=vr-button]');

async function showVr(inner = '', attributes: Readonly<Record<string, string>> = {}): Promise<GaussianSplatElement> {
  headset().device.position.set(0, 1.6, 0);
  const element = await showLoaded({ ...VR, ...attributes });
  element.innerHTML = inner;
  if (inner) await until(() => element.querySelector('splat-scene')!.loaded, 'the child', LIMIT_MS);
  await until(() => buttonOf(element) !== null, 'the button', LIMIT_MS);
  return element;
}

const hasStatus = (element: GaussianSplatElement, status: string) => (): boolean =>
  element.getAttribute('vr-status') === status;

async function leave(element: GaussianSplatElement): Promise<void> {
  element.exitXR!();
  await until(hasStatus(element, 'not-presenting'), 'the end', LIMIT_MS);
  headset().layer = undefined;
}

/** Decibels of an eye's bytes against the oracle of its camera. */
function closeness(
  element: GaussianSplatElement,
  cloud: GaussianCloud,
  eye: 'left' | 'right',
  found: Uint8Array,
  size = EYE,
): number {
  const oracle = renderOracle(cloud, cameraOf(element, eye, size), { rules: 'gsplat', mode: 'classic' });
  const rgba = toRgba(oracle);
  const expected = rgba.map((value, i) => {
    const behind = (1 - rgba[4 * Math.floor(i / 4) + 3]) * BACKGROUND[i % 4];
    return Math.round(255 * Math.min(1, value + behind)) / 255;
  });
  const values = Float32Array.from(found, (value) => value / 255);
  return psnr(values, expected, { mask: oracle.contributors, channels: 4, clamp: true });
}

const readCompass = async (): Promise<GaussianCloud> => readScene(await fetchScene(COMPASS), { name: 'compass.splat' });

/** Counts the sorts that a device records in a number of frames. */
async function sortsIn(binding: FakeBinding, frames: number): Promise<number> {
  const { beginComputePass } = GPUCommandEncoder.prototype;
  let sorts = 0;
  GPUCommandEncoder.prototype.beginComputePass = function (pass) {
    if (pass?.label === 'gs.sort') sorts++;
    return beginComputePass.call(this, pass);
  };
  const end = binding.frames + frames;
  await until(() => binding.frames >= end, 'frames', LIMIT_MS);
  const passed = frames + binding.frames - end;
  GPUCommandEncoder.prototype.beginComputePass = beginComputePass;
  return sorts / passed;
}

describe('VR by WebGPU', () => {
  let binding: FakeBinding | undefined;
  let element: GaussianSplatElement | undefined;

  afterEach(async () => {
    if (element?.getAttribute('vr-status') === 'session-started') await leave(element);
    element = undefined;
    binding?.remove();
    binding = undefined;
    headset().layer = undefined;
  });

  // The first test of the page, whose device is requested once.
  it('asks for an adapter that is compatible with headsets, also for an element in a shadow tree', async () => {
    headset();
    binding = fakeBinding('array', 1);
    const component = document.createElement('div');
    component.attachShadow({ mode: 'open' }).innerHTML = `<gaussian-splat vr src="${COMPASS}"></gaussian-splat>`;
    document.body.append(component);
    const inner = component.shadowRoot!.querySelector('gaussian-splat')!;
    await inner.ready;
    assert(inner.loaded && binding.isCompatible, 'compatible');
  });

  const layouts: readonly [Layout, number][] = [
    ['array', 1],
    ['side-by-side', 0.7],
  ];
  for (const [layout, share] of someOf(layouts, 1)) {
    it(`draws each eye as the oracle, in ${layout} textures with viewports of ${share}, with one sort a frame`, async () => {
      headset();
      binding = fakeBinding(layout, share);
      element = await showVr();
      const cloud = await readCompass();
      buttonOf(element)!.click();
      assert(binding.asked[0]?.includes('webgpu') === true, 'asked in the click');
      await until(() => binding!.frames > 4, 'a frame in the headset', LIMIT_MS);
      for (const eye of ['left', 'right'] as const) {
        const decibels = closeness(element, cloud, eye, await binding.pixels(eye), binding.size);
        console.log(`${layout}, ${eye} eye: ${decibels.toFixed(1)} dB`);
        assert(decibels >= MIN_DB, `${eye} eye: ${decibels.toFixed(1)} dB`);
      }
      assertEqual(await sortsIn(binding, 5), 1, 'sorts a frame');
      const before = await binding.pixels('left');
      element.setAttribute('filter', 'antialiased');
      const next = binding.frames + 3;
      await until(() => binding!.frames >= next, 'frames with another filter', LIMIT_MS);
      const after = await binding.pixels('left');
      assert(
        after.some((byte, i) => byte !== before[i]),
        'the filter has no effect',
      );
      assertEqual(headset().layer, undefined, 'a WebGL layer');
      assertEqual(binding.errors, [], 'errors of the GPU');
      assert(binding.isCompatible, 'the adapter was not asked for as compatible with headsets');
      await leave(element);
    });
  }

  for (const grant of someOf(['not granted', 'refused'] as const, 1)) {
    itInLab(`draws with WebGL after the same click if webgpu is ${grant}`, async () => {
      headset();
      binding = fakeBinding('array', 1, grant);
      element = await showVr();
      const cloud = await readCompass();
      buttonOf(element)!.click();
      await until(
        () =>
          headset().layer !== undefined &&
          headset()
            .pixels('left')
            .some((v, i) => i % 4 === 0 && v > 100),
        'an image',
        LIMIT_MS,
      );
      assertEqual(binding.enabled.length, 1, 'sessions');
      const decibels = closeness(element, cloud, 'right', headset().pixels('right'));
      assert(decibels >= MIN_DB, `right eye: ${decibels.toFixed(1)} dB`);
      await leave(element);
    });
  }

  it('copies a WebGPU canvas if the binding is not granted, for several scenes', async () => {
    headset();
    binding = fakeBinding('array', 1, 'not granted');
    element = await showVr(`<splat-scene src="${COMPASS}" position="0.5 0 0"></splat-scene>`);
    const cloud = moved(await readCompass(), 0.5);
    buttonOf(element)!.click();
    await until(
      () =>
        headset().layer !== undefined &&
        headset()
          .pixels('left')
          .some((v, i) => i % 4 === 0 && v > 100),
      'an image',
      LIMIT_MS,
    );
    for (const eye of ['left', 'right'] as const) {
      const decibels = closeness(element, cloud, eye, headset().pixels(eye));
      console.log(`copied, ${eye} eye: ${decibels.toFixed(1)} dB`);
      assert(decibels >= MIN_DB, `${eye} eye: ${decibels.toFixed(1)} dB`);
    }
    await leave(element);
  });

  it('a streamed child that comes in the session is drawn with its levels of detail', async () => {
    headset();
    binding = fakeBinding('array', 1);
    element = await showVr();
    const { draw } = Stereo.prototype;
    let budget = 0;
    Stereo.prototype.draw = function (...given) {
      budget = given[3]?.splatBudget ?? 0;
      return draw.apply(this, given);
    };
    try {
      buttonOf(element)!.click();
      await until(() => binding!.frames > 1, 'a frame in the headset', LIMIT_MS);
      assertEqual(budget, 0, 'budget of a scene without levels');
      const folder = detailFolder(pebbles(2_000));
      for (const [name, body] of folder.files) await fetch(`/net/kept/session/${name}`, { method: 'PUT', body });
      await fetch('/net/kept/session/detail.json', { method: 'PUT', body: JSON.stringify(folder.manifest) });
      element.innerHTML = '<splat-scene src="/net/kept/session/detail.json"></splat-scene>';
      await until(() => budget > 0, 'frames within the budget of the child', 2 * LIMIT_MS);
    } finally {
      Stereo.prototype.draw = draw;
    }
    await leave(element);
  });

  itInLab('keeps its scene while other loads need the memory of scenes that are out of view', async () => {
    headset();
    binding = fakeBinding('array', 1);
    element = await showVr();
    const ledger = MemoryLedger.of(devices[devices.length - 1]);
    const { unseenBytes } = ledger;
    ledger.unseenBytes = 0;
    try {
      buttonOf(element)!.click();
      await until(() => binding!.frames > 1, 'a frame in the headset', LIMIT_MS);
      await element.updateComplete;
      ledger.reserve('another load', 1_000).release();
      const { frames } = binding;
      await until(() => binding!.frames > frames + 3, 'further frames', LIMIT_MS);
      assert(element.loaded && hasStatus(element, 'session-started')(), 'the scene in the headset');
    } finally {
      ledger.unseenBytes = unseenBytes;
    }
    await leave(element);
  });

  itInLab('what moves in the page plays in the headset, and continues from there', async () => {
    headset();
    binding = fakeBinding('array', 1);
    const page = (element = await showVr('<splat-scene src="/net/clip/ball.gsv"></splat-scene>'));
    page.playbackRate = 0.1;
    await page.play();
    await until(() => page.currentTime > 0, 'the clip to play', LIMIT_MS);
    buttonOf(page)!.click();
    await until(() => binding!.frames > 1, 'a frame in the headset', LIMIT_MS);
    const [begin, before] = [performance.now(), page.currentTime];
    await until(() => page.currentTime > before + 0.05, 'the clip to play in the headset', LIMIT_MS);
    await leave(page);
    await nextEvent(page, 'timeupdate');
    const [passed, real] = [10 * (page.currentTime - before), (performance.now() - begin) / 1000];
    assert(passed <= real + 0.3, `${passed} s in place of ${real} s`);
  });

  itInLab('shows a clip that plays, and fails with the context of the copies', async () => {
    headset();
    binding = fakeBinding('array', 1, 'not granted');
    element = await showVr('', { src: '/net/clip/ball.gsv', loop: '' });
    await element.play();
    buttonOf(element)!.click();
    await until(() => headset().layer !== undefined, 'a WebGL layer', LIMIT_MS);
    const isLit = (at: 0 | 1 | 2) => (): boolean =>
      headset()
        .pixels('left')
        .some((value, i) => i % 4 === at && value > 150);
    for (const color of [0, 1, 2] as const) await until(isLit(color), `color ${color} of the clip`, LIMIT_MS);
    (headset().layer!.context.getExtension('WEBGL_lose_context') as WEBGL_lose_context).loseContext();
    await until(hasStatus(element, 'failed'), 'status after a loss', LIMIT_MS);
    headset().layer = undefined;
  });

  const losses = [
    ['the textures of the binding', undefined, {}],
    ['a canvas that is copied', 'not granted', { src: '/net/clip/ball.gsv', loop: '' }],
  ] as const;
  for (const [how, grant, attributes] of someOf(losses, 1))
    it(`the loss of the device ends a session that draws ${how}; the scene returns, and so does the headset`, async () => {
      headset();
      binding = fakeBinding('array', 1, grant);
      element = await showVr('', attributes);
      const page = element;
      const drawn = (): boolean => (grant ? headset().layer !== undefined : binding!.frames > 1);
      buttonOf(page)!.click();
      await until(drawn, 'a frame in the headset', LIMIT_MS);
      const said: string[] = [];
      for (const type of ['contextlost', 'contextrestored', 'error', 'emptied'])
        page.addEventListener(type, () => said.push(type));
      devices[devices.length - 1].destroy();
      await until(hasStatus(page, 'failed'), 'the end of the session', LIMIT_MS);
      await until(() => said.includes('contextrestored'), 'the scene again', 20_000);
      assertEqual([said, page.loaded, page.error], [['contextlost', 'contextrestored'], true, null], 'events');
      headset().layer = undefined;
      binding.remove();
      binding = fakeBinding('array', 1, grant);
      await until(() => buttonOf(page) !== null, 'the button', LIMIT_MS);
      buttonOf(page)!.click();
      await until(drawn, 'a frame of the second session', LIMIT_MS);
      await leave(page);
    });

  itInLab('a session that WebGL draws continues without the device', async () => {
    headset();
    binding = fakeBinding('array', 1, 'not granted');
    element = await showVr();
    const page = element;
    buttonOf(page)!.click();
    await until(() => headset().layer !== undefined, 'a WebGL layer', LIMIT_MS);
    const restored = nextEvent(page, 'contextrestored');
    devices[devices.length - 1].destroy();
    await restored;
    assert(page.loaded && hasStatus(page, 'session-started')(), 'the scene, in the page and in the headset');
    await leave(page);
  });

  itInLab('a session that starts while the device is lost fails, or shows the scene that returns', async () => {
    headset();
    binding = fakeBinding('array', 1);
    element = await showVr();
    const page = element;
    const restored = nextEvent(page, 'contextrestored');
    devices[devices.length - 1].destroy();
    buttonOf(page)!.click();
    const isSettled = (): boolean =>
      hasStatus(page, 'failed')() || (hasStatus(page, 'session-started')() && binding!.frames > 1);
    await until(isSettled, 'a failure, or a frame', LIMIT_MS);
    await restored;
    assert(page.loaded && page.error === null, 'the scene is back');
    if (hasStatus(page, 'session-started')()) await leave(page);
  });

  itInLab('sessions that copy a canvas leave none of it in memory', async () => {
    headset();
    binding = fakeBinding('array', 1, 'not granted');
    element = await showVr(`<splat-scene src="${COMPASS}" position="0.5 0 0"></splat-scene>`);
    const canvases: WeakRef<object>[] = [];
    const { OffscreenCanvas } = globalThis;
    globalThis.OffscreenCanvas = class extends OffscreenCanvas {
      constructor(width: number, height: number) {
        super(width, height);
        canvases.push(new WeakRef(this));
      }
    };
    try {
      for (let i = 0; i < 4; i++) {
        buttonOf(element)!.click();
        await until(() => headset().layer !== undefined && canvases.length > i, 'a WebGL layer', LIMIT_MS);
        await leave(element);
        await until(() => buttonOf(element!) !== null, 'the button', LIMIT_MS);
      }
    } finally {
      globalThis.OffscreenCanvas = OffscreenCanvas;
    }
    for (let i = 0; i < 3; i++) await executeServerCommand('heap-size');
    const kept = canvases.filter((canvas) => canvas.deref() !== undefined).length;
    // The emulator may keep its last session.
    assert(kept <= 1, `${kept} of ${canvases.length} canvases are in memory`);
  });

  it('a binding that fails ends the session, and the next click is drawn with WebGL', async () => {
    headset();
    binding = fakeBinding('array', 1, 'broken');
    element = await showVr();
    buttonOf(element)!.click();
    await until(hasStatus(element, 'failed'), 'the failure', LIMIT_MS);
    await claimComing(/no XR device/);
    await until(() => buttonOf(element!) !== null, 'the button', LIMIT_MS);
    buttonOf(element)!.click();
    await until(() => headset().layer !== undefined, 'a WebGL layer', LIMIT_MS);
    assertEqual(binding.asked.at(-1)!.includes('webgpu'), false, 'asked for webgpu again');
    await leave(element);
  });
});

/** The splats, and the same ones beside them. */
function moved(cloud: GaussianCloud, x: number): GaussianCloud {
  const twice = (values: Float32Array): Float32Array => {
    const out = new Float32Array(2 * values.length);
    out.set(values);
    out.set(values, values.length);
    return out;
  };
  const positions = twice(cloud.positions);
  for (let at = cloud.positions.length; at < positions.length; at += 3) positions[at] += x;
  return {
    ...cloud,
    positions,
    count: 2 * cloud.count,
    scales: twice(cloud.scales),
    rotations: twice(cloud.rotations),
    opacities: twice(cloud.opacities),
    sh: twice(cloud.sh),
  };
}
