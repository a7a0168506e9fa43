/** Arrays of a page instead of a file: whole scenes, ranges, growth, feeds, errors, and what none of it costs. */
import '@gaussian-splat/element';
import type { ElementError, GaussianSplatElement } from '@gaussian-splat/element';
import type { GaussianCloud } from '@gaussian-splat/core';
import { SplatGroups } from '@gaussian-splat/formats/groups';
import { encodeUpdate, type SplatUpdate } from '@gaussian-splat/formats/updates';
import { executeServerCommand } from '@web/test-runner-commands';
import { itInLab, someOf } from '../../support/extent-in-pages.js';
import { assert, assertEqual, delay, frames, nextEvent, show, until } from './support/harness.js';
import { isBlue, isGreen, isRed, screenOf } from './support/screen.js';

const RED = [1, 0, 0];
const GREEN = [0, 1, 0];
const BLUE = [0, 0, 1];

/** `count` opaque splats in a small ball around x, of one color. */
function ball(count: number, color: readonly number[], x = 0): SplatUpdate {
  const fill = (stride: number, value: (i: number, k: number) => number): Float32Array =>
    Float32Array.from({ length: stride * count }, (_, at) => value(Math.floor(at / stride), at % stride));
  return {
    positions: fill(3, (i, k) => (k === 0 ? x : 0) + 0.3 * Math.sin(i * (k + 1) * 1.7)),
    scales: fill(3, () => 0.1),
    rotations: fill(4, (_, k) => (k === 0 ? 1 : 0)),
    opacities: fill(1, () => 0.95),
    colors: fill(3, (_, k) => color[k]),
  };
}

async function shown(splats: GaussianSplatElement['splats'], attributes = {}): Promise<GaussianSplatElement> {
  const element = show({ alt: 'splats', ...attributes });
  element.splats = splats;
  await element.ready;
  assert(element.loaded, `not loaded: ${element.error?.message ?? 'no error'}`);
  return element;
}

/** Waits until most of the middle has a color. */
const turns = (element: GaussianSplatElement, isColor: typeof isRed, what: string): Promise<void> =>
  until(async () => ((await screenOf(element)).middleOf(isColor)?.count ?? 0) > 200, what);

/** Counts the buffers, textures and pipelines that are created while `act` runs. */
async function creations(act: () => Promise<unknown>): Promise<number> {
  const names = [
    'createBuffer',
    'createTexture',
    'createBindGroup',
    'createComputePipeline',
    'createRenderPipeline',
  ] as const;
  const originals = names.map((name) => GPUDevice.prototype[name]);
  let count = 0;
  names.forEach((name, k) => {
    (GPUDevice.prototype[name] as unknown) = function (this: GPUDevice, ...args: unknown[]) {
      count++;
      return (originals[k] as (...args: unknown[]) => unknown).apply(this, args);
    };
  });
  try {
    await act();
  } finally {
    names.forEach((name, k) => ((GPUDevice.prototype[name] as unknown) = originals[k]));
  }
  return count;
}

describe('the property splats', () => {
  it('shows arrays, and other arrays in their place within a frame, with the camera where it is', async () => {
    const element = await shown(ball(500, RED), { quality: 'default' });
    await turns(element, isRed, 'red splats');
    assertEqual([element.stats!.splats, element.stats!.dropped], [500, 0], 'splats, dropped');
    element.cameraOrbit = '30deg 80deg 4m';
    element.jumpCameraToGoal();
    await frames(4);
    const orbit = String(element.getCameraOrbit());
    const events: string[] = [];
    for (const type of ['load', 'emptied', 'error', 'generator-error', 'loadstart'])
      element.addEventListener(type, () => events.push(type));
    const { bytes } = element.stats!;
    const made = await creations(async () => {
      element.splats = ball(600, GREEN, 0.5);
      await frames(2);
      assertEqual(element.stats!.splats, 600, 'splats two frames later');
      await turns(element, isGreen, 'green splats');
      element.splats = ball(40, BLUE);
      await turns(element, isBlue, 'blue splats');
    });
    assertEqual(made, 0, 'buffers, textures, bind groups and pipelines of two updates');
    assertEqual(
      [element.stats!.splats, JSON.stringify(element.stats!.bytes)],
      [40, JSON.stringify(bytes)],
      'splats, bytes',
    );
    assertEqual([String(element.getCameraOrbit()), events.join()], [orbit, ''], 'camera, events');
    assert((await screenOf(element)).middleOf(isGreen) === null, 'no splat of the larger scene is left');
  });

  it('has as many splats as it needs when a scene grows, and takes harmonics after colors', async () => {
    const element = await shown(ball(300, RED));
    const before = element.stats!.bytes.scene;
    element.splats = ball(3_000, GREEN);
    await until(() => element.stats?.splats === 3_000, 'more splats');
    await turns(element, isGreen, 'green splats');
    assert(element.stats!.bytes.scene > before, 'more memory');
    const { colors, ...rest } = ball(3_000, BLUE);
    element.splats = { ...rest, sh: Float32Array.from(colors!, (c) => (c - 0.5) / 0.28209479177387814) };
    await turns(element, isBlue, 'blue harmonics');
  });

  itInLab('is shown with WebGL 2: other arrays, more of them, ranges and errors, without a gap', async () => {
    const element = await shown(ball(500, RED), { renderer: 'webgl' });
    await turns(element, isRed, 'red splats');
    assertEqual(element.stats!.renderer, 'webgl', 'renderer');
    element.cameraOrbit = '30deg 80deg 4m';
    element.jumpCameraToGoal();
    const orbit = String(element.getCameraOrbit());
    element.splats = {
      ...ball(3_000, GREEN),
      opacities: new Float32Array(3_000).fill(3),
      raw: true,
      scales: new Float32Array(9_000).fill(-2.3),
    };
    // Each frame has the splats of one state or of the other.
    await until(async () => {
      const screen = await screenOf(element);
      const [red, green] = [screen.middleOf(isRed)?.count ?? 0, screen.middleOf(isGreen)?.count ?? 0];
      assert(red + green > 200, `${red} red and ${green} green pixels`);
      return green > 200;
    }, 'green splats');
    assertEqual([element.stats!.splats, String(element.getCameraOrbit())], [3_000, orbit], 'splats, camera');
    const { scene } = element.stats!.bytes;
    await element.updateSplats!(0, { colors: ball(3_000, BLUE).colors });
    await turns(element, isBlue, 'blue splats');
    assertEqual(element.stats!.bytes.scene, scene, 'bytes');
    const empty = nextEvent<CustomEvent<ElementError>>(element, 'generator-error');
    element.splats = { ...ball(10, RED), positions: new Float32Array(30).fill(NaN) };
    assert(/a splat that can be drawn/.test((await empty).detail.message), 'NaN everywhere');
    element.splats = ball(300, GREEN);
    await turns(element, isGreen, 'green splats after an error');
  });

  it('updates a range, and leaves the arrays of the page as they are', async () => {
    const given = ball(400, RED);
    const element = await shown(given);
    await turns(element, isRed, 'red splats');
    await element.updateSplats!(0, { colors: ball(400, GREEN).colors });
    await turns(element, isGreen, 'green splats');
    assertEqual([...given.colors!.subarray(0, 3)], RED, 'the array of the page');
    await element.updateSplats!(200, { opacities: new Float32Array(200) });
    await element.updateSplats!(0, { opacities: new Float32Array(200) });
    await until(async () => (await screenOf(element)).middleOf(isGreen) === null, 'nothing');
    const fails = async (first: number, arrays: object, word: RegExp): Promise<void> => {
      const error = await element.updateSplats!(first, arrays).then(
        () => new Error('none'),
        (reason: Error) => reason,
      );
      assert(word.test(error.message) && /argument\/cloud/.test(error.message), error.message);
    };
    await fails(399, { opacities: new Float32Array(2) }, /within 400 splats, found 399 to 401/);
    await fails(0, { sh: new Float32Array(3) }, /sh/);
    await fails(0, { scales: new Float32Array(4) }, /3 for|whole splats|3 numbers/);
    assert(element.loaded, 'the scene stays');
  });

  it('takes values before activation, and shows the same', async () => {
    const plain = ball(200, RED);
    const log = Float32Array.from(plain.scales!, Math.log);
    const logits = Float32Array.from(plain.opacities!, (a) => Math.log(a / (1 - a)));
    const [a, b] = [await shown(plain), await shown({ ...plain, scales: log, opacities: logits, raw: true })];
    await turns(b, isRed, 'red splats');
    assertEqual((await screenOf(a)).differences(await screenOf(b), 2), 0, 'values that differ');
  });

  it('reports wrong lengths and NaN, keeps the last splats, and shows the next ones', async () => {
    const element = show({ alt: 'splats' });
    const failed = nextEvent<CustomEvent<ElementError>>(element, 'error');
    element.splats = { ...ball(10, RED), scales: new Float32Array(4) };
    assertEqual((await failed).detail.reason, 'argument/cloud', 'reason');
    element.splats = ball(300, GREEN);
    await nextEvent(element, 'load');
    await turns(element, isGreen, 'green splats after an error');
    const wrong = nextEvent<CustomEvent<ElementError>>(element, 'generator-error');
    element.splats = { ...ball(10, RED), rotations: undefined };
    assert(/splats\.rotations/.test((await wrong).detail.message), 'a missing array');
    const empty = nextEvent<CustomEvent<ElementError>>(element, 'generator-error');
    element.splats = { ...ball(10, RED), positions: new Float32Array(30).fill(NaN) };
    assert(/a splat that can be drawn/.test((await empty).detail.message), 'NaN everywhere');
    await turns(element, isGreen, 'green splats still');
    const some = ball(300, BLUE);
    some.opacities![7] = NaN;
    some.positions![30] = Infinity;
    element.splats = some;
    await turns(element, isBlue, 'the others');
    assertEqual(
      [element.stats!.splats, element.stats!.dropped, element.stats!.total],
      [298, 2, 300],
      'splats, dropped, total',
    );
  });

  it('is a property of <splat-scene>, too, within the limits of the page', async () => {
    const element = show({ alt: 'splats' });
    const child = document.createElement('splat-scene');
    child.splats = ball(300, GREEN);
    element.append(child);
    await turns(element, isGreen, 'green splats');
    child.splats = ball(310, BLUE);
    await turns(element, isBlue, 'blue splats');
    await child.updateSplats!(0, { colors: ball(310, RED).colors });
    await turns(element, isRed, 'red splats');
    const type = element.constructor as typeof GaussianSplatElement;
    type.sceneLimits = { maxSplats: 100, maxBytes: 10_000 };
    try {
      const other = show({ alt: 'splats' });
      const failed = nextEvent<CustomEvent<ElementError>>(other, 'error');
      other.splats = ball(101, RED);
      assertEqual((await failed).detail.reason, 'out-of-memory/budget', 'too many splats');
      const refused = nextEvent<CustomEvent<ElementError>>(other, 'error');
      other.splats = new Response(encodeUpdate(ball(200, RED))).body;
      assert(/10000 bytes/.test((await refused).detail.message), 'a message that is too long');
      other.splats = ball(100, GREEN);
      await turns(other, isGreen, 'a scene within the limits');
    } finally {
      type.sceneLimits = {};
    }
  });

  it('is shown instead of src, and gives it back', async () => {
    const element = await shown(ball(300, GREEN), { src: '/tests/element/browser/fixtures/compass.splat' });
    await turns(element, isGreen, 'green splats');
    assertEqual(element.stats!.splats, 300, 'splats');
    const loaded = nextEvent<CustomEvent<{ url: string }>>(element, 'load');
    element.splats = null;
    assert((await loaded).detail.url.endsWith('compass.splat'), 'the file');
    element.remove();
  });

  it('shows a removed element again with the splats that it was given meanwhile', async () => {
    const element = await shown(ball(300, RED));
    element.remove();
    element.splats = ball(310, GREEN);
    document.body.append(element);
    await turns(element, isGreen, 'green splats');
    assertEqual(element.stats!.splats, 310, 'splats');
  });
});

describe('groups of splats', () => {
  for (const renderer of someOf(['webgpu', 'webgl'], 1))
    it(`are picked, hidden and tinted by name: ${renderer}`, async () => {
      // Two balls, whose splats alternate in the arrays.
      const [left, right] = [ball(300, RED, -0.8), ball(300, [0.3, 0.4, 1], 0.8)];
      const mixed = (
        name: 'positions' | 'scales' | 'rotations' | 'opacities' | 'colors',
        stride: number,
      ): Float32Array =>
        Float32Array.from({ length: 600 * stride }, (_, at) => {
          const i = Math.floor(at / stride);
          return (i % 2 === 0 ? left : right)[name]![stride * Math.floor(i / 2) + (at % stride)];
        });
      const cloud: GaussianCloud = {
        ...{ count: 600, origin: [0, 0, 0], shDegree: 0, antialiased: false, droppedCount: 0 },
        ...{ positions: mixed('positions', 3), scales: mixed('scales', 3), rotations: mixed('rotations', 4) },
        ...{ opacities: mixed('opacities', 1), sh: mixed('colors', 3).map((c) => (c - 0.5) / 0.28209479177387814) },
      };
      const ids = Int32Array.from({ length: 600 }, (_, i) => (i % 2 === 0 ? 4 : 9));
      const groups = new SplatGroups(cloud, ids, { 4: 'left', 9: 'right' });
      const element = await shown(cloud, { renderer });
      await turns(element, isBlue, 'blue splats');
      const { x, y } = element.getBoundingClientRect();
      const picked = async (isColor: typeof isRed): Promise<string | undefined> => {
        const middle = (await screenOf(element)).middleOf(isColor)!;
        const hit = await element.positionFromPoint(x + middle.x, y + middle.y);
        return groups.of(hit?.splat)?.name;
      };
      assertEqual([await picked(isRed), await picked(isBlue)].join(), 'left,right', 'groups of the hits');
      await element.updateSplats!(0, groups.arraysFor({ hide: ['right'] }));
      await until(async () => (await screenOf(element)).middleOf(isBlue) === null, 'a hidden group');
      await element.updateSplats!(0, groups.arraysFor({ only: ['right'], tint: { right: [0, 1, 0] } }));
      // Its luma is 0.42.
      const isTinted: typeof isRed = ([r, g, b]) => g > 85 && g < 130 && r < 50 && b < 50;
      await turns(element, isTinted, 'a tinted group');
      assertEqual(
        [await picked(isTinted), (await screenOf(element)).middleOf(isRed)].join(),
        'right,',
        'the tinted group',
      );
      await element.updateSplats!(0, groups.arraysFor({}));
      await until(async () => (await screenOf(element)).middleOf(isRed) !== null, 'all groups');
      assert((await screenOf(element)).middleOf(isBlue), 'the color of the file');
    });
});

describe('a feed of splats', () => {
  it('is a stream of bytes whose newest state is shown, and which is canceled when it is replaced', async () => {
    let controller: ReadableStreamDefaultController<Uint8Array>;
    let isCanceled = false;
    const stream = new ReadableStream<Uint8Array>({
      start: (given) => void (controller = given),
      cancel: () => void (isCanceled = true),
    });
    const send = (update: SplatUpdate): void => {
      const bytes = new Uint8Array(encodeUpdate(update));
      for (let at = 0; at < bytes.length; at += 1_000) controller.enqueue(bytes.slice(at, at + 1_000));
    };
    const element = show({ alt: 'splats' });
    element.splats = stream;
    send(ball(300, RED));
    await nextEvent(element, 'load');
    await turns(element, isRed, 'red splats');
    for (let step = 0; step < 20; step++) send({ ...ball(250 + step, step === 19 ? BLUE : GREEN), step });
    send({ first: 0, opacities: new Float32Array(100) });
    await turns(element, isBlue, 'blue splats');
    assertEqual(element.stats!.splats, 269, 'splats');
    const failed = nextEvent<CustomEvent<ElementError>>(element, 'generator-error');
    send({ first: 200, opacities: new Float32Array(100) });
    assert(/within 269 splats/.test((await failed).detail.message), 'a range outside');
    element.splats = ball(20, RED);
    await turns(element, isRed, 'arrays');
    assert(isCanceled, 'the stream is canceled');
  });

  it('is the address of a WebSocket, whose server sends the newest state after each one that is shown', async () => {
    const url = await executeServerCommand<string, object>('start-training', { count: 300, everyMs: 2, greenAt: 400 });
    const log = (): Promise<TrainingLog> => executeServerCommand<TrainingLog, string>('training-log', url);
    const element = show({ alt: 'splats' });
    element.splats = url;
    await nextEvent(element, 'load');
    await turns(element, isGreen, 'green splats');
    const { requests, sent, step } = await log();
    assertEqual(requests[0], 'ready', 'first request');
    assert(sent.length <= requests.length && sent.length < step / 2, `${sent.length} of ${step} states sent`);
    assertEqual(requests.slice(1).join(), sent.slice(0, requests.length - 1).join(), 'steps that were shown, in order');
    element.style.display = 'none';
    await frames(4);
    const before = (await log()).requests.length;
    await delay(200);
    assert((await log()).requests.length <= before + 1, 'a scene that is not visible requests nothing');
    element.style.display = '';
    await until(async () => (await log()).requests.length > before + 2, 'requests of the visible scene');
    element.splats = ball(300, BLUE);
    await turns(element, isBlue, 'arrays instead');
    await until(async () => (await log()).closed.length === 1, 'the closed connection');
    await executeServerCommand('end-training', { url, code: 1000 });
  });

  itInLab('is a WebSocket of the page, whose server may send more than is shown', async () => {
    const url = await executeServerCommand<string, object>('start-training', {
      ...{ count: 2_000, everyMs: 4, greenAt: 80, pushes: true },
    });
    const socket = new WebSocket(url);
    await nextEvent(socket, 'open');
    const element = show({ alt: 'splats' });
    element.splats = socket;
    await nextEvent(element, 'load');
    await turns(element, isGreen, 'green splats');
    const { requests, sent } = await executeServerCommand<TrainingLog, string>('training-log', url);
    assert(requests.length < sent.length, `${requests.length} of ${sent.length} states were shown`);
    const failed = nextEvent<CustomEvent<ElementError>>(element, 'generator-error');
    await executeServerCommand('end-training', { url });
    assertEqual((await failed).detail.reason, 'network/interrupted', 'reason');
    assert(element.loaded, 'the last state stays');
  });

  it('that cannot be opened is an error, and another one is shown', async () => {
    const element = show({ alt: 'splats' });
    const failed = nextEvent<CustomEvent<ElementError>>(element, 'error');
    element.splats = 'ws://127.0.0.1:9/';
    assertEqual((await failed).detail.reason, 'network/interrupted', 'reason');
    element.splats = new Response(encodeUpdate(ball(300, BLUE))).body;
    await turns(element, isBlue, 'blue splats');
  });
});

interface TrainingLog {
  readonly requests: string[];
  readonly sent: number[];
  readonly step: number;
  readonly closed: number[];
}
