/** SECURITY.md: "The page keeps working". */
import '@gaussian-splat/element';
import { GaussianSplatElement, SharedDevice } from '@gaussian-splat/element';
import { itInLab } from '../../support/extent-in-pages.js';
import {
  assert,
  assertEqual,
  COMPASS,
  delay,
  devices,
  FIXTURES,
  frames,
  hurry,
  nextEvent,
  show,
  showLoaded,
  until,
} from './support/harness.js';
import { isGreen, isRed, screenOf } from './support/screen.js';

/** Runs work with another answer of the browser to the question for a GPU. */
async function withGpu(gpu: unknown, work: () => Promise<void>): Promise<void> {
  const sharedDevice = GaussianSplatElement.sharedDevice;
  GaussianSplatElement.sharedDevice = new SharedDevice();
  Object.defineProperty(navigator, 'gpu', { configurable: true, get: () => gpu });
  try {
    await work();
  } finally {
    Reflect.deleteProperty(navigator, 'gpu');
    GaussianSplatElement.sharedDevice = sharedDevice;
  }
}

describe('one device', () => {
  it('serves all elements of the page', async () => {
    const before = devices.length;
    const elements = Array.from({ length: 12 }, (_, i) =>
      show({ src: i % 2 ? `${FIXTURES}green.splat` : COMPASS }, 'display: inline-block; width: 60px; height: 50px'),
    );
    await Promise.all(elements.map((element) => element.ready));
    assert(
      elements.every((element) => element.loaded),
      'all loaded',
    );
    assert(devices.length - before <= 1, `${devices.length - before} new devices`);
    for (const [i, element] of elements.entries()) {
      const screen = await screenOf(element);
      assert(screen.middleOf(i % 2 ? isGreen : isRed), `element ${i} is seen`);
    }
  });

  it("may be the page's own", async () => {
    const original = GaussianSplatElement.sharedDevice;
    const adapter = await navigator.gpu.requestAdapter();
    assert(adapter, 'an adapter');
    const own = await adapter.requestDevice();
    GaussianSplatElement.sharedDevice = new SharedDevice(async () => own, { keepDevice: true });
    const delayBefore = GaussianSplatElement.releaseDelay;
    GaussianSplatElement.releaseDelay = 0;
    try {
      const before = devices.length;
      const element = await showLoaded();
      assertEqual(devices.length - before, 0, 'new devices');
      element.remove();
      await until(() => !element.loaded, 'the release');
      let isLost = false;
      void own.lost.then(() => (isLost = true));
      await delay(200);
      assertEqual(isLost, false, "the page's device is destroyed");
      own.destroy();
    } finally {
      // Elements that come soon have the device of those before, which is then the last again.
      devices.splice(devices.indexOf(own), 1);
      GaussianSplatElement.sharedDevice = original;
      GaussianSplatElement.releaseDelay = delayBefore;
    }
  });
});

describe('a function that gives devices', () => {
  const shown = async (request: () => GPUDevice): Promise<GaussianSplatElement> => {
    const original = GaussianSplatElement.sharedDevice;
    GaussianSplatElement.sharedDevice = new SharedDevice(request, { keepDevice: true });
    try {
      const element = show({ src: COMPASS, renderer: 'webgpu' });
      await element.ready;
      return element;
    } finally {
      GaussianSplatElement.sharedDevice = original;
    }
  };

  itInLab('may have one ready, and its exceptions are no fault of the file', async () => {
    const own = await (await navigator.gpu.requestAdapter())!.requestDevice();
    const element = await shown(() => own);
    assertEqual([element.loaded, element.error], [true, null], 'loaded');
    element.remove();
    devices.splice(devices.indexOf(own), 1);
    const { error } = await shown(() => {
      throw new Error('none is left');
    });
    assertEqual([error?.reason, error?.message.includes('none is left')], ['unsupported/no-adapter', true], 'error');
  });
});

describe('memory that is not to be had', () => {
  itInLab('for a larger frame than the first is reported, and the page keeps working', async () => {
    const element = await showLoaded({ src: COMPASS }, 'width: 60px; height: 50px');
    const { createTexture } = GPUDevice.prototype;
    let refused = 0;
    // Requests for a texture succeed, and the device must also allocate 200 GB.
    GPUDevice.prototype.createTexture = function (descriptor) {
      refused++;
      createTexture.call(this, { size: [8192, 8192, 200], format: 'rgba32float', usage: GPUTextureUsage.COPY_DST });
      return createTexture.call(this, descriptor);
    };
    try {
      element.style.width = '90px';
      await nextEvent(element, 'error');
    } finally {
      GPUDevice.prototype.createTexture = createTexture;
    }
    assert(refused > 0, 'nothing was allocated');
    assertEqual([element.error?.code, element.error?.reason], ['out-of-memory', 'out-of-memory/allocation'], 'codes');
    assert(element.error?.message.includes('90 x 50'), element.error?.message ?? 'no message');
    const other = await showLoaded({ src: COMPASS });
    assert((await screenOf(other)).middleOf(isRed), 'another element shows its scene');
  });
});

describe('the loss of the device', () => {
  it('is recovered from in silence: the same frame, one pair of events', async () => {
    const element = await showLoaded({ 'camera-orbit': '20deg 60deg 80%' });
    const before = await screenOf(element);
    const seen: string[] = [];
    for (const type of ['contextlost', 'contextrestored', 'load', 'error', 'progress']) {
      element.addEventListener(type, () => seen.push(type));
    }
    devices[devices.length - 1].destroy();
    await nextEvent(element, 'contextrestored');
    assertEqual(seen, ['contextlost', 'contextrestored'], 'events');
    assertEqual((await screenOf(element)).differences(before), 0, 'differing color values');
    assert(element.loaded && element.error === null, 'loaded');
  });

  it('is over with the scene that was set in the middle of it', async () => {
    const element = await showLoaded();
    const seen: string[] = [];
    for (const type of ['contextlost', 'contextrestored', 'load'])
      element.addEventListener(type, () => seen.push(type));
    devices[devices.length - 1].destroy();
    await nextEvent(element, 'contextlost');
    element.src = `${FIXTURES}green.splat`;
    await nextEvent(element, 'load');
    await frames();
    assertEqual(seen, ['contextlost', 'load', 'contextrestored'], 'events');
  });

  it('leaves the camera where a person has put it', async () => {
    const element = await showLoaded({ 'camera-controls': '' });
    element.shadowRoot?.querySelector('#view')?.dispatchEvent(new KeyboardEvent('keydown', { key: 'ArrowRight' }));
    element.jumpCameraToGoal();
    const before = String(element.getCameraOrbit());
    devices[devices.length - 1].destroy();
    await nextEvent(element, 'contextrestored');
    assertEqual(String(element.getCameraOrbit()), before);
  });

  itInLab('six times, every other time again in the middle of the recovery, ends with the same frame', async () => {
    const element = await showLoaded();
    const before = await screenOf(element);
    const seen: string[] = [];
    for (const type of ['contextlost', 'contextrestored', 'error'])
      element.addEventListener(type, () => seen.push(type));
    for (let i = 0; i < 6; i++) {
      const restored = nextEvent(element, 'contextrestored');
      const count = devices.length;
      devices[count - 1].destroy();
      if (i % 2) {
        await until(() => devices.length > count, 'a new device');
        await delay(5 * i);
        devices[devices.length - 1].destroy();
      }
      await restored;
      await frames(2);
      // The second loss may have come after the recovery; then another pair follows.
      await until(() => seen[seen.length - 1] === 'contextrestored', 'the last recovery');
      assertEqual((await screenOf(element)).differences(before), 0, `differing color values after loss ${i}`);
    }
    assert(
      seen.length >= 12 && seen.every((type, i) => type === ['contextlost', 'contextrestored'][i % 2]),
      seen.join(),
    );
  });

  itInLab('of several elements brings all of them back on one new device', async () => {
    const elements = await Promise.all([showLoaded(), showLoaded(), showLoaded({ src: `${FIXTURES}green.splat` })]);
    const before = devices.length;
    devices[before - 1].destroy();
    await Promise.all(elements.map((element) => nextEvent(element, 'contextrestored')));
    assertEqual(devices.length - before, 1, 'new devices');
  });

  itInLab('that lasts is an error after two tries: device-lost', async () => {
    const original = GaussianSplatElement.sharedDevice;
    let requests = 0;
    const { gpu } = navigator;
    GaussianSplatElement.sharedDevice = new SharedDevice(async () => {
      if (requests++ > 0) throw new Error('the GPU process does not answer');
      const adapter = await gpu.requestAdapter();
      assert(adapter, 'an adapter');
      return adapter.requestDevice();
    });
    try {
      const element = await showLoaded();
      // The page's own words take no room.
      element.innerHTML = '<span slot="error"></span>';
      const before = await screenOf(element);
      devices[devices.length - 1].destroy();
      await nextEvent(element, 'error');
      assertEqual([element.error?.code, element.error?.reason], ['device-lost', 'device-lost/unrecoverable'], 'codes');
      assert(before.middleOf(isRed), 'a frame before');
      assertEqual((await screenOf(element)).differences(before), 0, 'color values of the last frame that differ');
      const { message } = element.error!;
      const said =
        /lost \(reason "destroyed": Device was destroyed\), and no other in its place \(.*: the GPU process does not answer\)\. /;
      assert(said.test(message), message);
      assertEqual(requests, 3, 'requests for a device');
      assertEqual(element.loaded, false, 'loaded');
    } finally {
      GaussianSplatElement.sharedDevice = original;
    }
  });

  itInLab('is followed by a frame once the browser has a device again, without a reload', async () => {
    hurry(4);
    const original = GaussianSplatElement.sharedDevice;
    let refusals = 0;
    GaussianSplatElement.sharedDevice = new SharedDevice(async () => {
      if (refusals > 0) {
        refusals--;
        throw new Error('not now');
      }
      const adapter = await navigator.gpu.requestAdapter();
      assert(adapter, 'an adapter');
      return adapter.requestDevice();
    });
    try {
      const element = await showLoaded();
      const before = await screenOf(element);
      const seen: string[] = [];
      for (const type of ['contextlost', 'contextrestored', 'error', 'load'])
        element.addEventListener(type, () => seen.push(type));
      refusals = 3;
      devices[devices.length - 1].destroy();
      await nextEvent(element, 'error');
      assertEqual(element.error?.reason, 'device-lost/unrecoverable');
      await nextEvent(element, 'load', 40_000);
      await frames();
      assertEqual([...seen].sort(), ['contextlost', 'contextrestored', 'error', 'load'], 'events');
      assertEqual([element.loaded, element.error], [true, null], 'loaded');
      assertEqual((await screenOf(element)).differences(before), 0, 'differing color values');
      // Elements with a new scene, or with none, send no more requests.
      refusals = 3;
      devices[devices.length - 1].destroy();
      await nextEvent(element, 'error');
      element.src = null;
      await delay(8_000);
      assertEqual(refusals, 1, 'requests that were left');
    } finally {
      GaussianSplatElement.sharedDevice = original;
    }
  });

  itInLab('leaves no empty image: toBlob() returns the frame, or rejects with a reason', async () => {
    const element = await showLoaded();
    const size = async (blob: Blob): Promise<number> => {
      const { width, height } = await createImageBitmap(blob);
      return width * height;
    };
    const opaque = async (blob: Blob): Promise<number> => {
      const bitmap = await createImageBitmap(blob);
      const context = new OffscreenCanvas(bitmap.width, bitmap.height).getContext('2d')!;
      context.drawImage(bitmap, 0, 0);
      const { data } = context.getImageData(0, 0, bitmap.width, bitmap.height);
      return data.filter((value, i) => i % 4 === 3 && value > 0).length;
    };
    const whole = await element.toBlob();
    const expected = await opaque(whole);
    assert(expected > 0 && (await size(whole)) > 0, 'an image');
    for (let i = 0; i < 3; i++) {
      const restored = nextEvent(element, 'contextrestored');
      devices[devices.length - 1].destroy();
      let images = 0;
      for (let k = 0; k < 3; k++) {
        const blob = await element
          .toBlob()
          .catch((error: DOMException) => assertEqual(error.name, 'InvalidStateError'));
        if (!blob) continue;
        images++;
        assertEqual(await opaque(blob), expected, 'pixels that are not empty');
      }
      assert(images < 3, 'the loss was noticed');
      await restored;
      await frames();
    }
    assertEqual(await opaque(await element.toBlob()), expected, 'pixels in the end');
  });

  itInLab(
    'that comes twice more while the scene returns is an error, and the scene is back some seconds later',
    async () => {
      hurry(4);
      const original = GaussianSplatElement.sharedDevice;
      let losses = 0;
      GaussianSplatElement.sharedDevice = new SharedDevice(async () => {
        const device = await (await navigator.gpu.requestAdapter())?.requestDevice();
        assert(device, 'a device');
        if (losses-- > 0) device.destroy();
        return device;
      });
      try {
        const element = await showLoaded();
        const before = await screenOf(element);
        losses = 2;
        devices[devices.length - 1].destroy();
        await nextEvent(element, 'error');
        assertEqual([element.error?.reason, element.loaded], ['device-lost/unrecoverable', false], 'reason, loaded');
        await nextEvent(element, 'load');
        assertEqual([element.error, element.loaded], [null, true], 'error, loaded');
        assertEqual((await screenOf(element)).differences(before), 0, 'differing color values');
      } finally {
        GaussianSplatElement.sharedDevice = original;
      }
    },
  );

  itInLab('that comes with every first frame is an error too, not a loop', async () => {
    const original = GaussianSplatElement.sharedDevice;
    let requests = 0;
    GaussianSplatElement.sharedDevice = new SharedDevice(async () => {
      requests++;
      const device = await (await navigator.gpu.requestAdapter())?.requestDevice();
      assert(device, 'a device');
      device.destroy();
      return device;
    });
    try {
      const element = show({ src: COMPASS });
      await nextEvent(element, 'error');
      assertEqual([element.error?.reason, requests], ['device-lost/unrecoverable', 2], 'reason and requests');
      assert(
        /lost \(reason "destroyed": .*\)\. A script of this page/.test(element.error!.message),
        element.error!.message,
      );
    } finally {
      GaussianSplatElement.sharedDevice = original;
    }
  });
});

itInLab('a page with vr draws with WebGPU if no adapter is compatible with headsets', async () => {
  const { gpu } = navigator;
  const asked: unknown[] = [];
  const others = {
    getPreferredCanvasFormat: () => gpu.getPreferredCanvasFormat(),
    wgslLanguageFeatures: gpu.wgslLanguageFeatures,
    requestAdapter: (options: { xrCompatible?: boolean } & GPURequestAdapterOptions) => {
      asked.push(options.xrCompatible);
      return options.xrCompatible ? Promise.resolve(null) : gpu.requestAdapter(options);
    },
  };
  await withGpu(others, async () => {
    const element = show({ src: COMPASS, renderer: 'webgpu', vr: '' });
    await element.ready;
    assertEqual([element.loaded, element.error], [true, null], 'loaded and error');
    assertEqual(asked.slice(0, 2), [true, false], 'adapters that were requested');
    element.remove();
  });
});

describe('without WebGPU, where the page asks for it', () => {
  const ASKED = { src: COMPASS, renderer: 'webgpu' };
  const cases: Readonly<Record<string, readonly [gpu: unknown, reason: string, text: RegExp]>> = {
    'no API': [undefined, 'unsupported/no-webgpu', /current Chrome/],
    'no adapter': [{ requestAdapter: async () => null }, 'unsupported/no-adapter', /hardware acceleration/],
    'no device': [
      {
        requestAdapter: async () => ({
          features: new Set(),
          limits: {},
          requestDevice: () => Promise.reject(new Error('busy')),
        }),
      },
      'unsupported/limits',
      /graphics driver/,
    ],
  };
  for (const [name, [gpu, reason, text]] of Object.entries(cases)) {
    it(`${name}: the fallback says why at the edge, the page lives on`, async () => {
      await withGpu(gpu, async () => {
        const element = show(ASKED, 'width: 400px; height: 300px');
        await nextEvent(element, 'error');
        await element.ready;
        await element.updateComplete;
        assertEqual([element.error?.code, element.error?.reason], ['unsupported', reason], 'codes');
        assert(element.matches(':state(unsupported)') && element.matches(':state(error)'), 'states');
        const fallback = element.shadowRoot?.querySelector('slot[name=fallback] [part=fallback]')?.textContent ?? '';
        assert(text.test(fallback), fallback);
        const box = element.shadowRoot!.querySelector('[part=fallback]')!.getBoundingClientRect();
        const { bottom } = element.getBoundingClientRect();
        assert(box.bottom <= bottom && box.top > bottom - 100, `from ${box.top} to ${box.bottom} of ${bottom}`);
      });
    });
  }

  it('no adapter: WebGL continues with the one download, also if it arrives in parts', async () => {
    const splats = new Float32Array(8 * 40_000).map(
      (_, i) => [Math.sin(i), Math.cos(i), Math.sin(3 * i), 0.1, 0.1, 0.1][i % 8] ?? 0,
    );
    const bytes = new Uint8Array(splats.buffer).map((byte, i) => (i % 32 < 24 ? byte : 200));
    const compass = await (await fetch(COMPASS)).blob();
    for (const [name, body] of [
      ['small', compass],
      ['large', new Blob([bytes])],
    ] as const)
      for (const ms of [0, 300]) {
        const folder = `/net/kept/adapter-${name}-${ms}-${Math.round(performance.timeOrigin)}/`;
        await fetch(`${folder}a.splat`, { method: 'PUT', body });
        await withGpu({ requestAdapter: () => delay(ms).then(() => null) }, async () => {
          const element = show({ src: `${folder}a.splat` });
          await element.ready;
          assertEqual([element.error, element.stats?.renderer], [null, 'webgl'], `${name}, ${ms} ms`);
          assertEqual(element.stats?.splats, body.size / 32, 'splats');
          element.remove();
        });
        const log = (await (await fetch(`${folder}log`)).json()) as string[];
        if (name === 'small' || ms === 0) assertEqual(log.join(), 'a.splat', `requests, ${name}, ${ms} ms`);
      }
  });

  it('a poster replaces the scene, with its name, from any source', async () => {
    await withGpu(undefined, async () => {
      const gif = 'data:image/gif;base64,R0lGODlhAQABAAAAACw=';
      const element = show({ ...ASKED, poster: gif, alt: 'A compass', 'camera-controls': '' });
      const own = show({ ...ASKED, alt: 'Another' });
      own.innerHTML = `<img slot="poster" alt="" src="${gif}">`;
      for (const one of [element, own]) {
        await one.ready;
        await one.updateComplete;
        const root = one.shadowRoot!;
        assertEqual(one.error?.code, 'unsupported', 'error');
        assertEqual(
          [root.querySelector('[part=fallback]'), root.querySelector('[role=status]')?.textContent],
          [null, ''],
        );
        assert(root.querySelector('.poster:not(.gone)'), 'the poster is there');
        const view = root.querySelector('#view')!;
        assertEqual([view.getAttribute('role'), view.getAttribute('aria-label')], ['img', one.alt]);
        assertEqual(root.querySelector('[tabindex]'), null, 'nothing to reach by keyboard');
      }
    });
  });

  it('an adapter that never comes is an error', async () => {
    hurry(20);
    await withGpu({ ...navigator.gpu, requestAdapter: () => new Promise(() => undefined) }, async () => {
      const element = show(ASKED);
      await nextEvent(element, 'error', 30_000);
      assertEqual(element.error?.reason, 'unsupported/no-adapter');
      assert(/no answer within 20 s/.test(element.error?.message ?? ''), element.error?.message ?? '');
    });
  });

  it('not a byte of the scene is fetched', async () => {
    await withGpu(undefined, async () => {
      const src = `${COMPASS}?unfetched`;
      const element = show({ src, renderer: 'webgpu' });
      await nextEvent(element, 'error');
      await delay(200);
      const fetched = performance.getEntriesByType('resource').filter(({ name }) => name.includes('unfetched'));
      assertEqual(fetched.length, 0, 'requests');
    });
  });

  it("the page's own fallback takes the place of the default", async () => {
    await withGpu(undefined, async () => {
      const element = show(ASKED);
      const own = document.createElement('p');
      own.slot = 'fallback';
      own.textContent = 'An image instead';
      element.append(own);
      await nextEvent(element, 'error');
      await element.updateComplete;
      const slot = element.shadowRoot?.querySelector<HTMLSlotElement>('slot[name=fallback]');
      assertEqual(slot?.assignedElements().length, 1, 'slotted elements');
    });
  });

  it('an insecure page is advised to use https', async () => {
    Object.defineProperty(window, 'isSecureContext', { configurable: true, get: () => false });
    try {
      await withGpu(undefined, async () => {
        const element = show(ASKED);
        await nextEvent(element, 'error');
        assertEqual(element.error?.reason, 'unsupported/insecure-context');
      });
    } finally {
      Reflect.deleteProperty(window, 'isSecureContext');
    }
  });
});
