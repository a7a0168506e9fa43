/** Generators in <gaussian-splat>: declarative inputs, the media clock, faults that keep the last frame. */
import '@gaussian-splat/element';
import { GaussianSplatElement, type ElementError } from '@gaussian-splat/element';
import {
  assert,
  assertEqual,
  claimFault,
  COMPASS,
  delay,
  devices,
  nextEvent,
  show,
  showLoaded,
  until,
  hurry,
} from '../../element/browser/support/harness.js';
import { screenOf } from '../../element/browser/support/screen.js';
import { itInLab } from '../../support/extent-in-pages.js';
import { calls, FIXTURES } from './support.js';

GaussianSplatElement.runtimeLocation = '/net/compressed/onnxruntime-web/dist/';

const BALL = `${FIXTURES}packed.onnx`;
const OUTPUTS = { layout: 'packed', gaussians: 'gaussians', color: 'rgb', opacityActivation: 'linear' };
const contractWith = (more: object, inputs: object = { time: { role: 'time', unit: 'seconds' } }): string =>
  JSON.stringify({ version: 1, inputs, outputs: OUTPUTS, ...more });

const resources = (part: string): number =>
  performance.getEntriesByType('resource').filter(({ name }) => name.includes(part)).length;

const sizeOf = async (url: string): Promise<number> => (await (await fetch(url)).arrayBuffer()).byteLength;

/** Covered pixels of the screenshot, and their middle. */
async function imageOf(element: GaussianSplatElement): Promise<{ count: number; x: number; y: number }> {
  return (await screenOf(element)).middleOf(([r, g, b]) => r + g + b < 700) ?? { count: 0, x: 0, y: 0 };
}

beforeEach(() => hurry(3));

describe('a generator in the element', () => {
  it('no other scene fetches the runtime or the code for generators', async () => {
    await showLoaded({ src: COMPASS });
    assertEqual(
      [resources('onnxruntime-web'), resources('open-dynamic-model'), resources('packages/generator')].slice(0, 2),
      [0, 0],
    );
  });

  it('has a progress of model, runtime and warming up, that is not full before they are done', async () => {
    const watch = (element: GaussianSplatElement) => {
      const reported: { loaded: number; total: number; share: number; bar: number }[] = [];
      element.addEventListener('progress', ({ loaded, total }) => {
        void element.updateComplete.then(() => {
          const bar = element.shadowRoot?.querySelector('[role=progressbar]')?.getAttribute('aria-valuenow');
          reported.push({ loaded, total, share: element.progress, bar: Number(bar ?? NaN) });
        });
      });
      return reported;
    };
    const element = show({ src: BALL });
    const received = watch(element);
    const memories: object[] = [];
    let [arrived, arrivedBefore] = [0, NaN];
    element.addEventListener('progress', (event) => (arrived = event.loaded));
    element.addEventListener('generator-memory', ({ detail }) => {
      memories.push({ ...detail, gaussianBytes: detail.gaussianBytes > 0, isLoaded: element.loaded });
      arrivedBefore = arrived;
    });
    await element.ready;
    assert(element.loaded, String(element.error?.message));
    // Sums over the tensors of the file. It comes once.
    const memory = { weightBytes: 6656, largestKnownTensorBytes: 3328, unknownTensors: 2 };
    assertEqual(memories, [{ ...memory, gaussianBytes: true, isLoaded: false }], 'memory');
    const [model, runtime] = [await sizeOf(BALL), 'Suspending' in WebAssembly ? 16_758_545 : 26_781_914];
    assert(arrivedBefore <= model && arrived === model + runtime, `known before the runtime: ${arrivedBefore} bytes`);
    const known = received.filter(({ total }) => total > 0);
    assertEqual([...new Set(known.map(({ total }) => total))], [model + runtime], 'bytes in all');
    const between = known.filter(({ loaded }) => loaded > model + runtime / 10 && loaded < runtime);
    assert(between.length > 0, `none while the runtime comes: ${known.map(({ loaded }) => loaded).join(' ')}`);
    assert(
      known.every(({ share }, i) => i === 0 || share >= known[i - 1].share),
      'never back',
    );
    const whole = known.filter(({ loaded, total }) => loaded === total);
    assert(whole.length > 0 && whole.every(({ share, bar }) => share === 0.75 && bar === 75), JSON.stringify(whole));
    assertEqual(element.progress, 1, 'in the end');
    // Loaded files delay no request; files beside a model count.
    for (const src of [BALL, `${FIXTURES}external.onnx`]) {
      const next = show({ src });
      const reportedNext = watch(next);
      await next.ready;
      const size = (await sizeOf(src)) + (src === BALL ? 0 : await sizeOf(`${FIXTURES}external.weights`));
      assertEqual(reportedNext.at(-1)?.total, size, `bytes of ${src}`);
    }
    // It carries no contract.
    claimFault(/external\.onnx: input time is time/);
    claimFault(/external\.onnx: outputs are packed/);
  });

  it('is shown, with its duration, and fires load', async () => {
    const element = show({ src: BALL });
    const events: string[] = [];
    for (const type of ['durationchange', 'loadedmetadata', 'load', 'error', 'generator-error']) {
      element.addEventListener(type, () => events.push(type));
    }
    await element.ready;
    assert(element.loaded, String(element.error?.message));
    await until(() => events.includes('load'), 'load');
    assertEqual(events, ['durationchange', 'loadedmetadata', 'load']);
    assertEqual([element.stats?.splats, element.duration, element.paused], [64, 6.2831853, true]);
    const { count } = await imageOf(element);
    assert(count > 500, `${count} pixels are covered`);
  });

  it('follows the attribute time, and reports when the frame is visible', async () => {
    const element = await showLoaded({ src: BALL });
    const still = await imageOf(element);
    const [seeking, seeked] = [nextEvent(element, 'seeking'), nextEvent(element, 'seeked')];
    element.setAttribute('time', '1.5707');
    await seeking;
    assert(element.seeking, 'seeking until the frame is there');
    await seeked;
    await delay(200);
    const grown = await imageOf(element);
    assert(grown.count > 1.05 * still.count, `${still.count} pixels, then ${grown.count}`);
    assertEqual([element.currentTime, element.seeking], [1.5707, false]);
    const again = nextEvent(element, 'seeked');
    element.currentTime = 1.5707;
    await again;
    assertEqual(element.seeking, false, 'seeking, to the time that is shown');
  });

  it('plays, pauses, ends, loops and keeps the words of media elements', async () => {
    const element = await showLoaded({ src: BALL, contract: contractWith({ duration: 0.6 }) });
    const events: string[] = [];
    for (const type of ['play', 'playing', 'pause', 'ended', 'ratechange', 'seeking']) {
      element.addEventListener(type, () => events.push(type));
    }
    let updates = 0;
    element.addEventListener('timeupdate', () => updates++);
    await element.play();
    await nextEvent(element, 'ended');
    assertEqual(events, ['play', 'playing', 'pause', 'ended']);
    assertEqual([element.currentTime, element.ended, element.paused], [0.6, true, true]);
    assert(updates >= 2, `${updates} time updates`);
    element.loop = true;
    element.playbackRate = 2;
    await element.play();
    assertEqual([element.ended, element.currentTime < 0.6], [false, true]);
    await delay(1200);
    assert(!element.paused && element.currentTime >= 0 && element.currentTime <= 0.6, `${element.currentTime} s`);
    element.pause();
    const { currentTime } = element;
    await delay(100);
    assertEqual([element.currentTime, element.paused], [currentTime, true]);
    assertEqual(events.slice(4), ['ratechange', 'seeking', 'play', 'playing', 'pause']);
  });

  const withoutRate = contractWith({ inputs: { frame: { role: 'frame' } }, duration: 9 });
  for (const [what, src, contract = ''] of [
    ['a scene that does not move', COMPASS],
    ['a generator that takes no time', `${FIXTURES}split.onnx`],
    ['a generator of frames without a number of frames to a second', `${FIXTURES}frames.onnx`, withoutRate],
  ])
    it(`${what} cannot play`, async () => {
      const element = await showLoaded({ src, contract });
      const refusal = await element.play().then(
        () => 'none',
        (error: Error) => error.name,
      );
      assertEqual([refusal, Number.isNaN(element.duration), element.paused], ['NotSupportedError', true, true]);
    });

  it('takes pose and controls from attributes and properties', async () => {
    const element = await showLoaded(
      { src: `${FIXTURES}split.onnx` },
      'width: 120px; height: 100px; background: white',
    );
    const rest = await imageOf(element);
    // The fixture shifts all centers by the sum of the pose, along each axis.
    element.setAttribute('pose', '[[0.3, 0, 0], [0, 0, 0.2]]');
    await element.updateComplete;
    await delay(500);
    const shifted = await imageOf(element);
    assert(Math.abs(shifted.x - rest.x) > 2, `middle at ${rest.x}, then ${shifted.x}`);
    element.pose = new Float32Array(6);
    await element.updateComplete;
    await delay(500);
    const back = await imageOf(element);
    assert(Math.abs(back.x - rest.x) < 1, `middle at ${rest.x}, then ${back.x}`);
    const contract = contractWith({}, { time: { role: 'control', range: [-2, 2], default: 0 } });
    const slider = await showLoaded({ src: BALL, contract });
    const before = await imageOf(slider);
    slider.setAttribute('control-time', '1.57');
    await delay(600);
    const grown = await imageOf(slider);
    assert(grown.count > 1.05 * before.count, `attribute: ${before.count} pixels, then ${grown.count}`);
    slider.inputValues = { time: -1.57 };
    await delay(600);
    const shrunk = await imageOf(slider);
    assert(shrunk.count < 0.97 * before.count, `property: ${before.count} pixels, then ${shrunk.count}`);
  });

  it('stands on the axis that its contract declares, unless the attribute names one', async () => {
    const bounds = { min: [-1.2, -1.2, -1.2], max: [1.4, 1.6, 1.8] };
    const contract = contractWith({ bounds, coordinates: { up: '+z' } });
    const element = await showLoaded({ src: BALL, contract });
    const target = (): number[] => {
      const { x, y, z } = element.getCameraTarget();
      return [x, y, z].map((value) => Number(value.toFixed(5)));
    };
    assertEqual(target(), [0.1, 0.3, -0.2], 'z up');
    element.up = 'y';
    await element.updateComplete;
    assertEqual(target(), [0.1, 0.2, 0.3], 'y up, by the attribute');
    element.up = null;
    await element.updateComplete;
    assertEqual(target(), [0.1, 0.3, -0.2], 'z up again');
    const loaded = nextEvent(element, 'load');
    element.removeAttribute('contract');
    element.src = COMPASS;
    await loaded;
    const { y } = element.getCameraTarget();
    element.up = '-y';
    await element.updateComplete;
    assertEqual(element.getCameraTarget().y, y, 'a file is none that declares one');
    const free = await showLoaded({ src: BALL, contract: contractWith({ coordinates: { up: '+z' } }) });
    const [before, orbit] = [free.getCameraTarget().toString(), free.getCameraOrbit().toString()];
    free.up = 'z';
    await free.updateComplete;
    assertEqual([free.getCameraTarget().toString(), free.getCameraOrbit().toString()], [before, orbit], 'measured');
    await free.updateFraming();
    free.up = null;
    await free.updateComplete;
    assertEqual(free.getCameraTarget().toString(), before, 'framed again');
  });

  it('an invalid pose is reported once, and the last good frame stays', async () => {
    const element = await showLoaded({ src: `${FIXTURES}split.onnx` });
    const before = await imageOf(element);
    let faults = 0;
    element.addEventListener('generator-error', () => faults++);
    const event = nextEvent<CustomEvent<ElementError>>(element, 'generator-error');
    element.pose = [1, 2, 3];
    assertEqual((await event).detail.reason, 'argument/value');
    element.setAttribute('camera-orbit', '40deg 75deg auto');
    await delay(500);
    assertEqual([faults, element.loaded, element.error], [1, true, null]);
    assert((await imageOf(element)).count > 0.5 * before.count, 'the frame is gone');
  });

  it('makes no buffer and reads nothing back while it plays', async () => {
    // The times of frames are also read back if `auto` is set.
    const element = await showLoaded({ src: BALL, quality: 'default' });
    element.loop = true;
    await element.play();
    await delay(1000);
    const before = { ...calls };
    const time = element.currentTime;
    await delay(1000);
    assert(element.currentTime !== time, 'it does not play');
    const madeOf = ({ createBuffer, mapAsync, createComputePipeline, createComputePipelineAsync }: typeof calls) => [
      ...[createBuffer, mapAsync],
      ...[createComputePipeline, createComputePipelineAsync],
    ];
    assertEqual(madeOf(calls), madeOf(before));
    element.pause();
  });

  it('two at once, and a source that changes many times, end with what was asked for last', async () => {
    const [a, b] = [show({ src: BALL }), show({ src: `${FIXTURES}split.onnx` })];
    for (let i = 0; i < 8; i++) {
      a.src = i % 2 ? BALL : `${FIXTURES}split.onnx`;
      await delay(20 * i);
    }
    a.src = COMPASS;
    await a.updateComplete;
    a.src = BALL;
    await Promise.all([a.ready, b.ready]);
    assert(a.loaded && b.loaded, `${a.error?.message} ${b.error?.message}`);
    assertEqual([a.stats?.splats, b.stats?.splats], [64, 64]);
  });

  itInLab('is slow: orbiting continues at its own rate, and the latest time is shown in the end', async () => {
    const element = await showLoaded({ src: `${FIXTURES}heavy.onnx` });
    let frames = 0;
    const shown: number[] = [];
    element.addEventListener('camera-change', () => frames++);
    element.addEventListener('seeked', () => shown.push(element.currentTime));
    const start = performance.now();
    for (let i = 0; i < 30; i++) {
      element.currentTime = 1 + i / 10;
      element.setAttribute('camera-orbit', `${3 * i}deg 75deg auto`);
      element.jumpCameraToGoal();
      await new Promise(requestAnimationFrame);
    }
    const elapsed = performance.now() - start;
    await until(() => !element.seeking, 'the last frame');
    console.log(`${frames} frames and ${shown.length} runs in ${Math.round(elapsed)} ms`);
    assert(frames >= 15, `${frames} frames were drawn`);
    assert(shown.length <= frames, `${shown.length} runs for ${frames} frames`);
    assertEqual(element.currentTime, 1 + 29 / 10, 'visible time');
  });

  const faults: Readonly<Record<string, readonly [attributes: Record<string, string>, reason: string]>> = {
    'a missing file': [{ src: '/net/status/404?x.onnx', contract: contractWith({}) }, 'network/status'],
    'a web page': [{ src: '/net/html/x.onnx' }, 'decode/html'],
    'a truncated file': [{ src: '/net/head/packed.onnx' }, 'decode/truncated'],
    'a contract that is not there': [{ src: BALL, contract: '/net/status/404' }, 'network/status'],
    'a contract that is none': [{ src: BALL, contract: '{"version": 1}' }, 'contract/schema'],
    'a run that always fails': [{ src: `${FIXTURES}faulty-run.onnx` }, 'contract/run'],
  };
  for (const [name, [attributes, reason]] of Object.entries(faults)) {
    it(`${name}: ${reason}, and the next source is shown`, async () => {
      const element = show(attributes);
      const { detail } = await nextEvent<CustomEvent<ElementError>>(element, 'error');
      assertEqual([detail.reason, detail.code], [reason, reason.split('/')[0]]);
      element.contract = null;
      element.src = BALL;
      await element.ready;
      assert(element.loaded, String(element.error?.message));
    });
  }

  it('a lost device, while it plays: back on a new one, at its time', async () => {
    const element = await showLoaded({ src: BALL });
    element.loop = true;
    await element.play();
    await delay(300);
    const restored = nextEvent(element, 'contextrestored');
    devices[devices.length - 1].destroy();
    await restored;
    assert(element.loaded && !element.paused, 'shown and playing');
    await delay(400);
    assert((await imageOf(element)).count > 500, 'the frame is back');
    element.pause();
  });
});
