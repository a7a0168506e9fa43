/** Post-processors, chains and images in <gaussian-splat>. */
import '@gaussian-splat/element';
import { GaussianSplatElement, type ElementError } from '@gaussian-splat/element';
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
  hurry,
} from '../../element/browser/support/harness.js';
import { screenOf, type Rgb } from '../../element/browser/support/screen.js';
import { itInLab } from '../../support/extent-in-pages.js';
import { calls, FIXTURES, RUNTIME } from './support.js';

GaussianSplatElement.runtimeLocation = RUNTIME;

const BALL = `${FIXTURES}packed.onnx`;
const STYLE = 'width: 120px; height: 100px; background: white';

/** The colors of all pixels on the screen. */
async function colorsOf(element: GaussianSplatElement): Promise<Rgb[]> {
  const screen = await screenOf(element);
  const { clientWidth: width, clientHeight: height } = element;
  return Array.from({ length: width * height }, (_, i) => screen.at(i % width, Math.floor(i / width)));
}

/** Mean of all channels over the screenshot, 0..255, and how many pixels the scene covers. */
async function lightOf(element: GaussianSplatElement): Promise<{ mean: number; covered: number }> {
  const sums = (await colorsOf(element)).map(([r, g, b]) => r + g + b);
  const mean = sums.reduce((total, sum) => total + sum, 0) / sums.length / 3;
  return { mean, covered: sums.filter((sum) => sum < 700).length };
}

/** Waits until the image's brightness fulfils a condition. */
async function untilLight(
  element: GaussianSplatElement,
  holds: (mean: number) => boolean,
  what: string,
): Promise<void> {
  const end = performance.now() + 600_000;
  for (;;) {
    const { mean } = await lightOf(element);
    if (holds(mean)) return;
    assert(performance.now() < end, `waited for ${what}, found ${mean}`);
    await delay(100);
  }
}

/** Keeps the GPU at one run until the returned function is called. */
function holdGpu(): () => void {
  const { onSubmittedWorkDone } = GPUQueue.prototype;
  let end = (): void => undefined;
  const finished = new Promise<undefined>((resolve) => (end = () => resolve(undefined)));
  GPUQueue.prototype.onSubmittedWorkDone = () => finished;
  return () => {
    Object.assign(GPUQueue.prototype, { onSubmittedWorkDone });
    end();
  };
}

beforeEach(() => hurry(3));

describe('a post-processor in the element', () => {
  for (const [name, src] of [
    ['post.onnx', BALL],
    ['post-fixed.onnx', COMPASS],
  ] as const) {
    it(`${name} on ${src.split('/').at(-1)}: darkens what is drawn, leaves the page's ground, and goes again`, async () => {
      const element = await showLoaded({ src }, STYLE);
      const plain = await lightOf(element);
      const plainBytes = element.stats!.bytes.frames;
      element.setAttribute('control-gain', '0');
      element.setAttribute('postprocess', FIXTURES + name);
      await untilLight(element, (mean) => mean < plain.mean - 2, 'a darker frame');
      const dark = await lightOf(element);
      // Three images of its size, eight bytes a pixel, and the tensor for the model.
      assert(element.stats!.bytes.frames > plainBytes + 24 * 120 * 100, 'stats count its images');
      assert(dark.covered > 0.5 * plain.covered, `${plain.covered} pixels were covered, now ${dark.covered}`);
      assertEqual((await screenOf(element)).at(1, 1), [255, 255, 255], 'the ground of the page');
      element.setAttribute('control-gain', '1');
      await untilLight(element, (mean) => Math.abs(mean - plain.mean) < 1.5, 'the unprocessed frame');
      element.setAttribute('control-gain', '0');
      await untilLight(element, (mean) => mean < plain.mean - 2, 'a darker frame');
      element.removeAttribute('postprocess');
      await untilLight(element, (mean) => Math.abs(mean - plain.mean) < 0.5, 'the plain frame');
    });
  }

  it('at rest runs once, and then neither draws nor runs', async () => {
    const element = await showLoaded(
      { src: COMPASS, postprocess: `${FIXTURES}post-fixed.onnx`, 'control-gain': '0' },
      STYLE,
    );
    await untilLight(element, (mean) => mean < 250, 'the processed frame');
    await delay(300);
    const { createBuffer, mapAsync, createBindGroup } = calls;
    await delay(1000);
    assertEqual(
      [calls.createBuffer, calls.mapAsync, calls.createBindGroup],
      [createBuffer, mapAsync, createBindGroup],
      'calls at rest',
    );
  });

  it('images of any size and background are processed, and the page keeps its own', async () => {
    const element = await showLoaded({ src: COMPASS }, STYLE);
    const plain = await lightOf(element);
    element.setAttribute('control-gain', '0');
    element.setAttribute('postprocess', `${FIXTURES}post-fixed.onnx`);
    await untilLight(element, (mean) => mean < plain.mean - 2, 'the processed frame');
    const { mean } = await lightOf(element);
    for (const options of [
      {},
      { background: 'white' },
      { width: 60, height: 50 },
      { width: 240, background: '#fff' },
    ]) {
      const image = await createImageBitmap(await element.toBlob(options));
      const context = new OffscreenCanvas(image.width, image.height).getContext('2d')!;
      context.fillStyle = 'white';
      context.fillRect(0, 0, image.width, image.height);
      context.drawImage(image, 0, 0);
      const { data } = context.getImageData(0, 0, image.width, image.height);
      const light = data.reduce((sum, value, i) => sum + (i % 4 < 3 ? value : 0), 0) / (3 * (data.length / 4));
      assert(Math.abs(light - mean) < 0.8, `${JSON.stringify(options)}: ${light}, in the page ${mean}`);
    }
    assert(Math.abs((await lightOf(element)).mean - mean) < 0.2, 'the page');
  });

  itInLab('that is slow does not delay the camera, and shows its image at rest', async () => {
    const element = await showLoaded(
      { src: COMPASS, postprocess: `${FIXTURES}post-slow.onnx`, 'control-gain': '0' },
      STYLE,
    );
    await untilLight(element, (mean) => mean < 250, 'the processed frame');
    let moves = 0;
    element.addEventListener('camera-change', () => moves++);
    for (let i = 0; i < 20; i++) {
      element.setAttribute('camera-orbit', `${5 * i}deg 75deg auto`);
      element.jumpCameraToGoal();
      await frames(1);
    }
    await frames(2);
    assert(moves >= 10, `${moves} frames were drawn while it ran`);
    const settled = await lightOf(element);
    await untilLight(element, (mean) => mean < 250, `the processed frame again (${settled.mean})`);
  });

  it('takes a control that has changed during a run, without another reason for a frame', async () => {
    const element = await showLoaded({ src: COMPASS }, STYLE);
    const plain = await lightOf(element);
    element.setAttribute('control-gain', '0');
    element.setAttribute('postprocess', `${FIXTURES}post-fixed.onnx`);
    await untilLight(element, (mean) => mean < plain.mean - 2, 'a darker frame');
    const finish = holdGpu();
    element.setAttribute('control-gain', '0.5');
    await frames(3);
    element.setAttribute('control-gain', '1');
    await frames(3);
    finish();
    await untilLight(element, (mean) => Math.abs(mean - plain.mean) < 1.5, 'the frame of the last value');
  });

  it('reports a control that neither it nor the scene has, and no other', async () => {
    const reported: ElementError[] = [];
    const attributes = { postprocess: `${FIXTURES}post.onnx`, 'control-gain': '0', 'control-gaim': '1' };
    const element = show({ src: BALL, ...attributes }, STYLE);
    element.addEventListener('generator-error', ({ detail }) => reported.push(detail));
    await until(() => reported.length > 0, 'a report');
    await delay(500);
    assertEqual(reported.length, 1, reported.map(({ message }) => message).join('; '));
    assert(/control gaim: expected one of the inputs .*gain/.test(reported[0].message), reported[0].message);
  });

  itInLab('is that of the new size after the element has got one', async () => {
    const element = await showLoaded({ src: COMPASS, 'control-gain': '0' }, STYLE);
    const plain = await lightOf(element);
    element.setAttribute('postprocess', `${FIXTURES}post.onnx`);
    await untilLight(element, (mean) => mean < plain.mean - 20, 'the processed frame');
    const before = await lightOf(element);
    element.style.cssText = 'width: 200px; height: 160px; background: white';
    await delay(300);
    await untilLight(element, (mean) => Math.abs(mean - before.mean) < 12, 'the processed frame, larger');
  });

  itInLab('that is slow keeps no image of intermediate sizes', async () => {
    const element = await showLoaded(
      { src: COMPASS, postprocess: `${FIXTURES}post-slow.onnx`, 'control-gain': '0' },
      STYLE,
    );
    await untilLight(element, (mean) => mean < 250, 'the processed frame');
    const live = new Set<GPUTexture>();
    const { createTexture } = GPUDevice.prototype;
    const { destroy } = GPUTexture.prototype;
    GPUDevice.prototype.createTexture = function (descriptor) {
      const texture = createTexture.call(this, descriptor);
      live.add(texture);
      return texture;
    };
    GPUTexture.prototype.destroy = function () {
      live.delete(this);
      return destroy.call(this);
    };
    const finish = holdGpu();
    try {
      const max: number[] = [];
      for (let width = 121; width <= 150; width++) {
        element.style.width = `${width}px`;
        await frames(2);
        max.push(live.size);
      }
      assert(Math.max(...max) <= 20, `textures: ${max.join(' ')}`);
    } finally {
      finish();
      Object.assign(GPUDevice.prototype, { createTexture });
      Object.assign(GPUTexture.prototype, { destroy });
    }
  });

  it('that makes no numbers leaves the frame as it is drawn', async () => {
    const element = await showLoaded({ src: COMPASS }, STYLE);
    const plain = await lightOf(element);
    element.setAttribute('postprocess', `${FIXTURES}post-nan.onnx`);
    await delay(1500);
    const after = await lightOf(element);
    assert(Math.abs(after.mean - plain.mean) < 0.5, `${plain.mean}, then ${after.mean}`);
  });

  for (const [name, url, reason] of [
    ['that is missing', '/net/status/404?x.onnx', 'network/status'],
    ['that makes Gaussians', BALL, 'contract/chain'],
  ] as const) {
    it(`${name}: ${reason}, and frames as they are drawn`, async () => {
      const element = await showLoaded({ src: COMPASS }, STYLE);
      const plain = await lightOf(element);
      const event = nextEvent<CustomEvent<ElementError>>(element, 'generator-error');
      element.setAttribute('postprocess', url);
      assertEqual((await event).detail.reason, reason);
      element.setAttribute('camera-orbit', '1deg 75deg auto');
      await delay(300);
      assert(element.loaded && Math.abs((await lightOf(element)).mean - plain.mean) < 1, 'the frame stays');
    });
  }

  it('is back after the device was lost', async () => {
    const element = await showLoaded(
      { src: COMPASS, postprocess: `${FIXTURES}post-fixed.onnx`, 'control-gain': '0' },
      STYLE,
    );
    await untilLight(element, (mean) => mean < 250, 'the processed frame');
    const restored = nextEvent(element, 'contextrestored');
    devices[devices.length - 1].destroy();
    await restored;
    await untilLight(element, (mean) => mean < 250, 'the processed frame');
  });
});

describe('a chain in the element', () => {
  itInLab('is one scene, whose controls are those of all its models', async () => {
    const element = await showLoaded({ src: BALL, chain: `${FIXTURES}link-fixed.onnx` }, STYLE);
    const middle = async (): Promise<number> =>
      (await screenOf(element)).middleOf(([r, g, b]) => r + g + b < 700)?.y ?? NaN;
    const before = await middle();
    element.setAttribute('control-lift', '0.5');
    await delay(700);
    const after = await middle();
    // The scene's y points down.
    assert(after > before + 3, `middle at ${before}, then ${after}`);
    assertEqual(element.duration, 6.2831853, 'duration');
  });

  it('that does not fit: contract/chain, and without it the scene is shown', async () => {
    const element = show({ src: BALL, chain: `${FIXTURES}link-logit.onnx` });
    const { detail } = await nextEvent<CustomEvent<ElementError>>(element, 'error');
    assertEqual([detail.code, detail.reason], ['contract', 'contract/chain']);
    element.removeAttribute('chain');
    await element.updateComplete;
    await element.ready;
    assert(element.loaded, String(element.error?.message));
  });
});

describe('an image as a control', () => {
  /** Red and blue halves. */
  async function photo(left: string, right: string): Promise<string> {
    const canvas = new OffscreenCanvas(16, 16);
    const context = canvas.getContext('2d');
    assert(context, 'a 2D context');
    context.fillStyle = left;
    context.fillRect(0, 0, 8, 16);
    context.fillStyle = right;
    context.fillRect(8, 0, 8, 16);
    return URL.createObjectURL(await canvas.convertToBlob());
  }

  itInLab('by URL, by image, by ImageBitmap; a wrong one is named and the last stays', async () => {
    const url = await photo('red', 'blue');
    const errors: string[] = [];
    const element = await showLoaded({ src: `${FIXTURES}picture.onnx`, 'control-image': url }, STYLE);
    const count = async (channel: number): Promise<number> => {
      return (await colorsOf(element)).filter(
        (color) => color[channel] > 60 + Math.max(...color.filter((_, other) => other !== channel)),
      ).length;
    };
    assert((await count(0)) > 100 && (await count(2)) > 100, `${await count(0)} red, ${await count(2)} blue`);
    const image = new Image();
    image.src = await photo('lime', 'red');
    element.inputValues = { image };
    await until(() => image.complete, 'the image');
    const untilCounts = async (holds: (counts: number[]) => boolean, what: string): Promise<void> => {
      const end = performance.now() + 10_000;
      for (;;) {
        const counts = [await count(0), await count(1), await count(2)];
        if (holds(counts)) return;
        assert(performance.now() < end, `waited for ${what}, found ${counts.join()}`);
        await delay(100);
      }
    };
    element.addEventListener('generator-error', ({ detail }) => errors.push(detail.reason));
    await untilCounts(([red, green, blue]) => red > 100 && green > 100 && blue < 20, 'green and red');
    assertEqual(errors, [], 'errors');
    const event = nextEvent<CustomEvent<ElementError>>(element, 'generator-error');
    element.inputValues = { image: '/net/status/404' };
    assertEqual((await event).detail.reason, 'network/status');
    assert(element.loaded && (await count(1)) > 100, 'the last image stays');
    // The header of a GIF of 65,535 x 65,535 pixels, which would take 16 GB after decoding.
    const gif = new File([Uint8Array.of(0x47, 0x49, 0x46, 0x38, 0x39, 0x61, 255, 255, 255, 255, 0, 0, 0)], 'a.gif');
    const refusal = nextEvent<CustomEvent<ElementError>>(element, 'generator-error');
    element.inputValues = { image: gif };
    const { detail } = await refusal;
    assertEqual(detail.reason, 'decode/unknown-format');
    assert(/PNG, JPEG, WebP or AVIF/.test(detail.message), detail.message);
    const bytes = await (await fetch(await photo('blue', 'blue'))).blob();
    element.inputValues = { image: await createImageBitmap(bytes) };
    await untilCounts(([, green, blue]) => blue > 200 && green < 20, 'blue');
  });
});
