/**
 * Faults of the web, one by one: each is named or recovered from, the last good frame stays, and the element beside it
 * still works.
 */
import '@gaussian-splat/element';
import { GaussianSplatElement, type ElementError } from '@gaussian-splat/element';
import { Generator, GaussianModels, setRunLimit, setRuntimeLocation } from '@gaussian-splat/generator';
import {
  assert,
  assertEqual,
  COMPASS,
  delay,
  devices,
  frames,
  nextEvent,
  show,
  showLoaded,
  until,
} from '../../element/browser/support/harness.js';
import { screenOf } from '../../element/browser/support/screen.js';
import { itInLab } from '../../support/extent-in-pages.js';
import { codeOf, FIXTURES, makeDevice, ReadingSink, RUNTIME } from './support.js';

GaussianSplatElement.runtimeLocation = RUNTIME;

const BALL = `${FIXTURES}packed.onnx`;
const HALF = `${FIXTURES}packed-sh-half.onnx`;
const OUTPUTS = { layout: 'packed', gaussians: 'gaussians', color: 'rgb', opacityActivation: 'linear' };
const TIME = { time: { role: 'time', unit: 'seconds' } };
const contract = (more: object = {}): string => JSON.stringify({ version: 1, inputs: TIME, outputs: OUTPUTS, ...more });
/** The contract of the model of changing length, with other facts. */
const halfContract = (nMax: number, min: number): string =>
  JSON.stringify({
    version: 1,
    inputs: { share: { role: 'control', range: [min, 2], default: 0.5 } },
    outputs: { ...OUTPUTS, color: 'sh', shOrder: 'coefficient-major', count: 'count' },
    nMax,
  });

/** Covered pixels on the screen. */
async function coverOf(element: GaussianSplatElement): Promise<number> {
  return (await screenOf(element)).middleOf(([r, g, b]) => r + g + b < 700)?.count ?? 0;
}

async function withOpset(version: number): Promise<string> {
  const bytes = new Uint8Array(await (await fetch(BALL)).arrayBuffer());
  const entry = [0x42, 0x04, 0x0a, 0x00, 0x10, 17];
  const at = bytes.findIndex((_, i) => entry.every((byte, k) => bytes[i + k] === byte));
  bytes[at + 5] = version;
  return `${URL.createObjectURL(new Blob([bytes]))}#newer.onnx`;
}

/** An error for people says all of this. */
function assertNamed({ reason, message, cause }: ElementError, expected: string): void {
  assertEqual(reason as string, expected, message);
  const { expected: what, found, remedy } = cause as { expected?: string; found?: string; remedy?: string };
  assert(what && found !== undefined && remedy, `expected, found, what to do: ${message}`);
}

type Attributes = Readonly<Record<string, string>>;

/** The scene cannot be shown. */
const REFUSED: Readonly<
  Record<string, readonly [reason: string, attributes: Attributes | (() => Promise<Attributes>)]>
> = {
  'a wrong role': ['contract/schema', { src: BALL, contract: contract({ inputs: { time: { role: 'tiem' } } }) }],
  'a wrong shape': ['contract/shape', { src: BALL, contract: contract({ inputs: { time: { role: 'viewport' } } }) }],
  'a wrong element type': ['contract/dtype', { src: BALL, contract: contract({ dtype: 'float16' }) }],
  'an input without a role': ['contract/unbound-input', { src: BALL, contract: contract({ inputs: {} }) }],
  'no contract, and names that say nothing': ['contract/inference', { src: `${FIXTURES}subgraphs.onnx` }],
  'a web page': ['decode/html', { src: '/net/html/x.onnx' }],
  'a pointer to a file': ['decode/lfs-pointer', { src: '/net/lfs/x.onnx' }],
  'a truncated file': ['decode/truncated', { src: '/net/head/packed.onnx' }],
  'an empty file': ['decode/unknown-format', { src: '/net/empty/x.onnx' }],
  'an opset that is too new': ['contract/opset', async () => ({ src: await withOpset(27) })],
  'external data that is missing': ['contract/external-data', { src: '/net/renamed/external.onnx' }],
  'a missing file': ['network/status', { src: '/net/status/404?x.onnx', contract: contract() }],
  'a missing contract': ['network/status', { src: BALL, contract: '/net/status/404' }],
  'a contract beside the model that is no JSON': ['contract/json', { src: '/net/sidecar/json/canonical.onnx' }],
  'a contract beside the model that is another one': [
    'contract/unbound-input',
    { src: '/net/sidecar/other/canonical.onnx' },
  ],
  'a connection that breaks': ['network/interrupted', { src: '/net/cut-model/packed.onnx' }],
  'a length that is too long': ['network/interrupted', { src: '/net/too-long/packed.onnx' }],
  'a length that is too short': ['decode/truncated', { src: '/net/too-short/packed.onnx' }],
  'another origin that does not agree': [
    'network/unreachable',
    async () => {
      const origin = await (await fetch('/net/other-origin')).text();
      return { src: `${origin}/closed/compass.ply`, contract: contract() };
    },
  ],
  'too many Gaussians for the device': ['out-of-memory/buffer-limit', { src: HALF, contract: halfContract(2e9, 0) }],
  'a first run that fails': ['contract/run', { src: `${FIXTURES}faulty-run.onnx` }],
  'a chain that does not fit': ['contract/chain', { src: BALL, chain: `${FIXTURES}link-logit.onnx` }],
};

describe('a fault that is in the way of the scene', () => {
  let neighbor: GaussianSplatElement | undefined;

  for (const [name, [reason, given]] of Object.entries(REFUSED)) {
    it(`${name}: ${reason}`, async () => {
      neighbor = show({ src: BALL });
      const attributes = typeof given === 'function' ? await given() : given;
      const element = show(attributes);
      const { detail } = await nextEvent<CustomEvent<ElementError>>(element, 'error');
      assertNamed(detail, reason);
      await neighbor.ready;
      assert(neighbor.loaded, `the element beside it: ${neighbor.error?.message}`);
    });
  }

  it('is over with the next source', async () => {
    const element = show({ src: '/net/html/x.onnx' });
    await nextEvent(element, 'error');
    element.src = BALL;
    await element.ready;
    assert(element.loaded && element.error === null, String(element.error?.message));
  });

  it('the runtime that is not where it was said to be: named, and found when it is', async () => {
    GaussianSplatElement.runtimeLocation = '/nowhere/';
    try {
      // Another address, since open files need no other runtime.
      const element = show({ src: `${BALL}?elsewhere` });
      const { detail } = await nextEvent<CustomEvent<ElementError>>(element, 'error');
      assertEqual(detail.code, 'network', detail.message);
    } finally {
      GaussianSplatElement.runtimeLocation = RUNTIME;
    }
    const element = await showLoaded({ src: `${BALL}?elsewhere` });
    assert((await coverOf(element)) > 300, 'an image');
  });
});

describe('a fault that the scene survives', () => {
  it('NaN, infinity and a count above N: the rest is drawn', async () => {
    const element = await showLoaded({ src: `${FIXTURES}faulty-values.onnx` });
    assert((await coverOf(element)) > 300, 'an image');
  });

  it('a run that fails after good ones: contract/run, the last good frame, and back again', async () => {
    const element = await showLoaded({ src: `${FIXTURES}faulty-later.onnx` });
    const neighbor = await showLoaded({ src: BALL });
    const before = await coverOf(element);
    const event = nextEvent<CustomEvent<ElementError>>(element, 'generator-error');
    element.currentTime = 1;
    assertNamed((await event).detail, 'contract/run');
    assert(element.loaded && Math.abs((await coverOf(element)) - before) < 0.05 * before, 'the last good frame');
    const seeked = nextEvent(element, 'seeked');
    element.currentTime = 0.5;
    await seeked;
    const alive = nextEvent(neighbor, 'seeked');
    neighbor.currentTime = 2;
    await alive;
  });

  itInLab('no Gaussian at all, and a count below zero: nothing is drawn, and more when there are more', async () => {
    for (const share of ['0', '-0.5']) {
      const element = await showLoaded({ src: HALF, contract: halfContract(100, -1), 'control-share': share });
      assertEqual(await coverOf(element), 0, `pixels of share ${share}`);
      element.setAttribute('control-share', '1');
      element.setAttribute('camera-target', '0m 0m 0m');
      element.setAttribute('camera-orbit', '0deg 75deg 4m');
      const end = performance.now() + 10_000;
      while ((await coverOf(element)) < 300) assert(performance.now() < end, 'no image');
    }
  });

  it('a control that no input has, and one out of its range: named once, the nearest value counts', async () => {
    const element = await showLoaded({ src: HALF, contract: halfContract(100, 0) });
    const reported: ElementError[] = [];
    element.addEventListener('generator-error', ({ detail }) => reported.push(detail));
    element.setAttribute('control-shaer', '0.7');
    element.setAttribute('control-share', '5');
    await until(() => reported.length >= 2, 'two reports');
    element.setAttribute('camera-orbit', '10deg 75deg auto');
    await delay(300);
    assertEqual(reported.length, 2, 'reports');
    for (const error of reported) assertNamed(error, 'argument/value');
    assert(
      reported.some(({ message }) => message.includes('share')),
      'the inputs are listed',
    );
    assert(element.loaded && (await coverOf(element)) > 300, 'an image');
  });

  it('centers that meet in one point are drawn, and no fault', async () => {
    const element = await showLoaded({ src: `${FIXTURES}meeting.onnx` });
    const reported: ElementError[] = [];
    element.addEventListener('generator-error', ({ detail }) => reported.push(detail));
    // Longer than the look at what runs wrote waits for them to rest.
    await delay(1500);
    assertEqual([reported.map(({ message }) => message), element.stats?.dropped], [[], 0], 'reports, rows dropped');
  });

  itInLab('float16 without shader-f16: on the CPU, and said so', async () => {
    const element = show({ src: HALF });
    const fallback = nextEvent<CustomEvent<{ reason: string }>>(element, 'generator-fallback');
    await element.ready;
    if (devices.at(-1)?.features.has('shader-f16')) return console.log('not tested: this device has shader-f16');
    assert((await fallback).detail.reason.includes('shader-f16'), 'the reason');
    assert(element.loaded && (await coverOf(element)) > 200, 'an image');
  });

  it('two contracts: the one that the page gives counts', async () => {
    const element = await showLoaded({ src: BALL, contract: contract({ duration: 0.6 }) });
    assertEqual(element.duration, 0.6);
  });

  it('a device lost while a run is on its way: back on a new one', async () => {
    const element = await showLoaded({ src: `${FIXTURES}heavy.onnx` });
    const neighbor = await showLoaded({ src: COMPASS });
    const restored = [nextEvent(element, 'contextrestored'), nextEvent(neighbor, 'contextrestored')];
    element.currentTime = 3;
    await frames(1);
    devices[devices.length - 1].destroy();
    await Promise.all(restored);
    const seeked = nextEvent(element, 'seeked');
    element.currentTime = 5;
    await seeked;
    assert(element.loaded && neighbor.loaded, 'both are back');
  });

  it('an element that is removed while it runs: the others continue', async () => {
    const element = await showLoaded({ src: `${FIXTURES}heavy.onnx` });
    const neighbor = await showLoaded({ src: BALL });
    element.currentTime = 4;
    await frames(1);
    element.remove();
    await delay(GaussianSplatElement.releaseDelay + 200);
    const seeked = nextEvent(neighbor, 'seeked');
    neighbor.currentTime = 1;
    await seeked;
  });

  itInLab('a source that changes 1,000 times ends with the last', async () => {
    const element = await showLoaded({ src: BALL });
    const sources = [`${FIXTURES}split.onnx`, BALL, COMPASS, `${FIXTURES}canonical.onnx`, '/net/html/x.onnx'];
    for (let i = 0; i < 1000; i++) {
      element.src = `${sources[i % sources.length]}?${i % 7}`;
      await element.updateComplete;
      if (i % 100 === 50) await delay(30);
    }
    element.src = `${FIXTURES}split.onnx`;
    await element.updateComplete;
    await element.ready;
    assert(element.loaded, String(element.error?.message));
    assert((await coverOf(element)) > 300, 'an image');
  });
});

describe('faults of pages that use the generator without the element', () => {
  itInLab('generators that follow one another in a circle, or no other', async () => {
    const models = new GaussianModels();
    models.registerGaussianGenerator('body', { url: `${FIXTURES}link-fixed.onnx` }, { after: 'clothes' });
    models.registerGaussianGenerator('clothes', { url: `${FIXTURES}link-fixed.onnx` }, { after: 'body' });
    const device = await makeDevice();
    assertEqual(await codeOf(models.loadAllGenerators(device)), 'contract/chain');
    const lonely = new GaussianModels();
    lonely.registerGaussianGenerator('clothes', { url: `${FIXTURES}link-fixed.onnx` }, { after: 'nobody' });
    assertEqual(await codeOf(lonely.loadAllGenerators(device)), 'argument/value');
    device.destroy();
  });

  it('an inference that never ends is given up, and others run in another copy of the runtime', async () => {
    setRuntimeLocation(RUNTIME);
    const [own, other] = [await makeDevice(), await makeDevice()];
    const errors: { code: string; message: string }[] = [];
    const onError = (error: unknown): void => void errors.push(error as { code: string; message: string });
    const warm = await Generator.open({ url: BALL }, other, { onError });
    const sink = (warm.sink = new ReadingSink(other));
    warm.request({ timeSeconds: 0 });
    await warm.idle;
    setRunLimit(1500);
    const endless = await Generator.open({ url: `${FIXTURES}endless.onnx` }, own, { onError });
    endless.sink = new ReadingSink(own);
    endless.request({ timeSeconds: 1 });
    await endless.idle;
    setRunLimit(120_000);
    // Ends what still runs.
    own.destroy();
    assertEqual(
      errors.map(({ code }) => code),
      ['contract/run'],
      errors.map(({ message }) => message).join(),
    );
    assert(errors[0].message.includes('no result within 1500 ms'), errors[0].message);
    for (let i = 1; i < 4; i++) {
      warm.request({ timeSeconds: i });
      await warm.idle;
    }
    assert(
      sink.runs.length >= 2,
      `${sink.runs.length} runs of the other, ${errors.map(({ message }) => message).join()}`,
    );
    endless.close();
    warm.close();
    await Promise.all(sink.runs.map(({ tensors }) => tensors.gaussians));
    other.destroy();
  });

  itInLab('a model that waits behind one that never ends is not blamed for it, and runs on the GPU', async () => {
    setRuntimeLocation(RUNTIME);
    const [own, other] = [await makeDevice(), await makeDevice()];
    const reported: string[] = [];
    const onError = (error: unknown): void => void reported.push((error as { message: string }).message);
    const onFallback = (reason: string): void => void reported.push(reason);
    const endless = await Generator.open({ url: `${FIXTURES}endless.onnx?behind` }, own);
    const waiting = await Promise.all(
      ['first', 'second', 'third'].map(async (name) => {
        // The last two share a session.
        const url = `${BALL}?behind=${name === 'first'}`;
        const generator = await Generator.open({ url }, other, { onError, onFallback });
        generator.sink = { ingest: () => undefined };
        return generator;
      }),
    );
    waiting[0].request({ timeSeconds: 0 });
    await waiting[0].idle;
    setRunLimit(1500);
    endless.sink = new ReadingSink(own);
    endless.request({ timeSeconds: 1 });
    await delay(300);
    setRunLimit(120_000);
    for (const [i, generator] of waiting.entries()) generator.request({ timeSeconds: 1 + i });
    await endless.idle;
    // Ends what still runs.
    own.destroy();
    await Promise.all(waiting.map(({ idle }) => idle));
    assertEqual([reported, waiting.map(({ runs }) => runs)], [[], [2, 1, 1]], 'errors and fallbacks, runs');
    assert(
      waiting.every(({ kind }) => kind !== 'wasm'),
      'on the GPU',
    );
    for (const generator of [endless, ...waiting]) generator.close();
    other.destroy();
  });
});
