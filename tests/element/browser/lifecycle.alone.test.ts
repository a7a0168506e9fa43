import '@gaussian-splat/element';
import { GaussianSplatElement } from '@gaussian-splat/element';
import {
  assert,
  assertEqual,
  COMPASS,
  delay,
  devices,
  FIXTURES,
  frames,
  gated,
  nextEvent,
  show,
  showLoaded,
  submits,
  until,
} from './support/harness.js';
import { whileHidden } from './support/hidden.js';
import { isGreen, isRed, screenOf } from './support/screen.js';

const canvasOf = (element: GaussianSplatElement): HTMLCanvasElement => {
  const canvas = element.shadowRoot?.querySelector('canvas');
  assert(canvas, 'a canvas');
  return canvas;
};
const canvasSize = (element: GaussianSplatElement): [number, number] => [
  canvasOf(element).width,
  canvasOf(element).height,
];

describe('power', () => {
  it('an idle page submits nothing to the GPU for 3 s', async () => {
    await showLoaded({ 'camera-controls': '' });
    await showLoaded({ src: `${FIXTURES}green.splat` });
    await frames(5);
    const before = submits;
    assert(before > 0, 'the counter counts');
    await delay(3_000);
    assertEqual(submits - before, 0, 'submits');
  });

  it('a motion draws until it has come to rest, then stops', async () => {
    // A full frame follows a reduced motion with "auto": one more frame.
    const element = await showLoaded({ quality: 'default' });
    let changes = 0;
    element.addEventListener('camera-change', () => changes++);
    const before = submits;
    element.cameraOrbit = '40deg 75deg auto';
    await until(() => Math.abs(element.getCameraOrbit().theta - (40 * Math.PI) / 180) < 1e-12, 'the goal');
    await frames(3);
    assert(changes > 5, `${changes} camera-change events`);
    assertEqual(submits - before, changes, 'one submit for each change');
    const after = submits;
    await delay(500);
    assertEqual(submits - after, 0, 'submits at rest');
  });

  it('a hidden page draws nothing, and catches up when it is seen again', async () => {
    const element = await showLoaded({ 'interpolation-decay': '0' });
    await frames(3);
    let before = submits;
    await whileHidden(async () => {
      element.cameraOrbit = '40deg 75deg auto';
      await delay(300);
      assertEqual(submits - before, 0, 'submits while hidden');
      before = submits;
    });
    await until(() => submits > before, 'a frame');
    assert(Math.abs(element.getCameraOrbit().theta - (40 * Math.PI) / 180) < 1e-12, 'at the new place');
  });

  it('off screen nothing is drawn', async () => {
    const element = await showLoaded({ 'interpolation-decay': '0' });
    element.style.marginTop = '5000px';
    await delay(200);
    const before = submits;
    element.cameraOrbit = '40deg 75deg auto';
    await delay(300);
    assertEqual(submits - before, 0, 'submits');
    element.style.marginTop = '';
    await until(() => submits > before, 'a frame once it is back');
  });

  it('a lazy element off screen fetches nothing; an eager one is ready before it is seen', async () => {
    let progress = 0;
    const below = 'width: 100px; height: 100px; margin-top: 5000px';
    const lazy = show({ src: COMPASS }, below);
    lazy.addEventListener('progress', () => progress++);
    const eager = show({ src: COMPASS, loading: 'eager' }, below);
    await eager.ready;
    assert(eager.loaded, 'the eager one is loaded');
    assertEqual(progress, 0, 'progress of the lazy one');
    lazy.style.marginTop = '0';
    await lazy.ready;
    assert(lazy.loaded, 'the lazy one loads in the viewport');
  });

  it('play() loads a lazy element off screen, and not the scene that replaces it', async () => {
    const element = show({ src: COMPASS }, 'width: 100px; height: 100px; margin-top: 5000px');
    const failure = await element.play().catch(({ name }: Error) => name);
    assertEqual([failure, element.loaded], ['NotSupportedError', true], 'failure, loaded');
    let loads = 0;
    element.addEventListener('loadstart', () => loads++);
    element.src = `${FIXTURES}green.splat`;
    await element.updateComplete;
    await delay(200);
    assertEqual(loads, 0, 'loads');
  });
});

describe('size', () => {
  it('follows the element with its frame', async () => {
    const element = await showLoaded();
    assertEqual(canvasSize(element), [120, 100], 'at first');
    element.style.width = '200px';
    await until(() => canvasOf(element).width === 200, 'a wider canvas');
    const screen = await screenOf(element);
    const red = screen.middleOf(isRed);
    assert(red && red.x > 110, `red at ${red?.x}`);
    assertEqual(screen.differences(await screenOf(element)), 0, 'differences of two frames');
  });

  it('without size draws nothing, yet is loaded, and draws when it gets one', async () => {
    const before = submits;
    const element = show({ src: COMPASS, loading: 'eager' }, 'display: none');
    await element.ready;
    assert(element.loaded, 'loaded');
    assertEqual(submits - before, 0, 'submits');
    element.style.cssText = 'width: 80px; height: 60px';
    await until(() => submits > before, 'a frame');
    assertEqual(canvasSize(element), [80, 60], 'canvas');
    element.style.width = '0';
    await delay(200);
    const zero = submits;
    element.cameraOrbit = '90deg auto auto';
    await delay(200);
    assertEqual(submits - zero, 0, 'submits at width 0');
  });

  it('follows the zoom of the page', async () => {
    const element = await showLoaded();
    document.body.style.zoom = '1.5';
    try {
      await until(() => canvasOf(element).width === 180, 'one and a half times the pixels');
      assertEqual([element.clientWidth, ...canvasSize(element)], [120, 180, 150], 'CSS width and canvas');
    } finally {
      document.body.style.zoom = '';
    }
    await until(() => canvasOf(element).width === 120, 'the old size');
  });

  it('is none with the attribute hidden, also on a page that says display: block as guides do', async () => {
    const style = document.createElement('style');
    style.textContent = 'gaussian-splat { display: block }';
    document.body.append(style);
    const element = await showLoaded();
    const displays = ['', 'until-found'].map((hidden) => {
      element.setAttribute('hidden', hidden);
      const { display, contentVisibility } = getComputedStyle(element);
      return [display, contentVisibility];
    });
    // Text that the browser's search can find and reveal is not hidden.
    assertEqual([displays[0][0], displays[1]], ['none', ['block', 'hidden']], 'display, and content-visibility');
  });

  it('is 300 x 150 without a style, as other embedded content', async () => {
    const element = show({}, '');
    assertEqual([element.clientWidth, element.clientHeight], [300, 150]);
  });
});

describe('moves and removals', () => {
  const alive = (): number => devices.length;

  it('a move within the page costs nothing', async () => {
    const element = await showLoaded();
    let progress = 0;
    element.addEventListener('progress', () => progress++);
    const before = alive();
    const box = document.createElement('div');
    document.body.append(box);
    box.append(element);
    await delay(300);
    assert(element.loaded, 'still loaded');
    assertEqual([progress, alive() - before], [0, 0], 'progress events and new devices');
    const seen: boolean[] = [];
    element.addEventListener('model-visibility', ({ detail }) => seen.push(detail.visible));
    element.remove();
    assertEqual(seen, [false], 'off-screen with its removal');
    box.append(element);
    await until(() => seen.length > 1, 'its being seen again');
    assertEqual(seen, [false, true], 'one event for each change');
    assert((await screenOf(element)).middleOf(isRed), 'still seen');
  });

  it('a removed element frees its GPU memory, and loads again when it is inserted again', async () => {
    const delayBefore = GaussianSplatElement.releaseDelay;
    GaussianSplatElement.releaseDelay = 50;
    try {
      const element = await showLoaded({ src: `${FIXTURES}green.splat` });
      const device = devices[devices.length - 1];
      let isLost = false;
      void device.lost.then(({ reason }) => (isLost = reason === 'destroyed'));
      element.remove();
      await element.updateComplete;
      await until(() => isLost, 'the last user to have destroyed the device');
      assertEqual([element.loaded, element.stats], [false, null], 'after the delay');
      document.body.append(element);
      await nextEvent(element, 'load');
      assert(isGreen((await screenOf(element)).at(60, 50)), 'seen again');
    } finally {
      GaussianSplatElement.releaseDelay = delayBefore;
    }
  });

  it('a removed element keeps its scene for as long as releaseDelay says, for ever if that is Infinity', async () => {
    const delayBefore = GaussianSplatElement.releaseDelay;
    GaussianSplatElement.releaseDelay = Infinity;
    try {
      const element = await showLoaded();
      element.remove();
      await delay(300);
      assertEqual(element.loaded, true, 'loaded');
      document.body.append(element);
    } finally {
      GaussianSplatElement.releaseDelay = delayBefore;
    }
  });

  it('an eager element off screen loads again as well', async () => {
    const delayBefore = GaussianSplatElement.releaseDelay;
    GaussianSplatElement.releaseDelay = 0;
    try {
      const element = await showLoaded({ loading: 'eager' }, 'width: 100px; height: 100px; margin-top: 5000px');
      element.remove();
      await until(() => !element.loaded, 'the release');
      document.body.append(element);
      await nextEvent(element, 'load');
    } finally {
      GaussianSplatElement.releaseDelay = delayBefore;
    }
  });

  it('a removal in the middle of loading ends it, and ready still settles', async () => {
    const delayBefore = GaussianSplatElement.releaseDelay;
    GaussianSplatElement.releaseDelay = 0;
    try {
      const { src, open } = gated('compass.ply');
      const element = show({ src });
      let events = 0;
      await nextEvent(element, 'progress');
      for (const type of ['progress', 'load', 'error']) element.addEventListener(type, () => events++);
      element.remove();
      await element.ready;
      events = 0;
      await open();
      await delay(300);
      assertEqual([element.loaded, events], [false, 0], 'loaded, events');
    } finally {
      GaussianSplatElement.releaseDelay = delayBefore;
    }
  });

  it('40 rounds of putting in and taking out leave one device, or none', async () => {
    const delayBefore = GaussianSplatElement.releaseDelay;
    GaussianSplatElement.releaseDelay = 0;
    const lost = new Set<GPUDevice>();
    try {
      for (let round = 0; round < 40; round++) {
        const element = show({ src: COMPASS, loading: 'eager' });
        if (round % 4 > 0) await delay(round);
        else assert(await element.ready.then(() => element.loaded), 'a scene, and so a device');
        element.remove();
      }
      for (const device of devices) void device.lost.then(() => lost.add(device));
      await until(() => devices.every((device) => lost.has(device)), 'all devices to be destroyed');
    } finally {
      GaussianSplatElement.releaseDelay = delayBefore;
    }
    await showLoaded();
  });
});

describe('properties', () => {
  it('set before the element is defined, count', async () => {
    const element = document.createElement('late-splat') as GaussianSplatElement;
    Object.assign(element, { src: COMPASS, loading: 'eager', cameraControls: true, currentTime: 2, playbackRate: 3 });
    document.body.append(element);
    customElements.define('late-splat', class extends GaussianSplatElement {});
    await element.ready;
    assertEqual([element.loaded, element.cameraControls], [true, true]);
    assertEqual([element.currentTime, element.playbackRate], [2, 3]);
    element.currentTime = 4;
    assert(!Object.hasOwn(element, 'currentTime'), 'the accessor is hidden by a property of the same name');
  });

  it('that a framework takes back are as if never set', async () => {
    const element = await showLoaded();
    Object.assign(element, { playbackRate: 2, currentTime: 1 });
    for (const nothing of [undefined, null]) Object.assign(element, { playbackRate: nothing, currentTime: nothing });
    assertEqual([element.playbackRate, element.currentTime], [1, 1]);
    let thrown = '';
    try {
      element.currentTime = NaN;
    } catch (error) {
      thrown = String(error);
    }
    assert(thrown.includes('expects a finite number'), thrown);
  });

  it('of addresses take lists, too, and any other value causes no script error', async () => {
    const element = await showLoaded();
    const missing = nextEvent<CustomEvent<{ message: string }>>(element, 'generator-error');
    Object.assign(element, { chain: [], postprocess: ['/a/missing.onnx'] });
    assert((await missing).detail.message.includes('/a/missing.onnx'), 'the address is named');
    Object.assign(element, { chain: null, postprocess: undefined });
    await element.updateComplete;
    assert(element.loaded, 'the scene is still there');
    const again = nextEvent(element, 'generator-error', 1_000);
    Object.assign(element, { postprocess: '/a/missing.onnx' });
    await again;
  });
});

describe('paper', () => {
  it('has the image, which browsers omit from WebGPU canvases, and only while it is printed', async () => {
    const element = await showLoaded();
    const canvases = (): HTMLCanvasElement[] => [...element.shadowRoot!.querySelectorAll('canvas')];
    dispatchEvent(new Event('beforeprint'));
    const [, copy] = canvases();
    const { data } = copy.getContext('2d')!.getImageData(0, 0, copy.width, copy.height);
    const image = new Image();
    image.src = element.toDataURL();
    await image.decode();
    const truth = new OffscreenCanvas(copy.width, copy.height).getContext('2d')!;
    truth.drawImage(image, 0, 0);
    const wanted = truth.getImageData(0, 0, copy.width, copy.height).data;
    // Straight alpha and back costs a step or two.
    const largest = data.reduce((max, value, i) => Math.max(max, Math.abs(value - wanted[i])), 0);
    assert(largest <= 4 && data.some((value) => value > 0), `differs by ${largest}`);
    dispatchEvent(new Event('afterprint'));
    assertEqual(canvases().length, 1, 'canvases');
  });
});
