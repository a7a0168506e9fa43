/** Post-processors with more inputs than the frame: its depth, its camera, and their output for the previous frame. */
import '@gaussian-splat/element';
import '@gaussian-splat/element/scenes.js';
import { GaussianSplatElement } from '@gaussian-splat/element';
import type { SplatMeshElement } from '@gaussian-splat/element/scenes.js';
import {
  assert,
  assertEqual,
  COMPASS,
  delay,
  hurry,
  showLoaded,
  until,
} from '../../element/browser/support/harness.js';
import { boxGlb } from '../../element/browser/support/glb.js';
import { screenOf, type Rgb } from '../../element/browser/support/screen.js';
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

/** Waits until the pixel in the middle has a color, as far as it is given. */
async function untilPixel(element: GaussianSplatElement, color: readonly (number | undefined)[]): Promise<void> {
  let found: readonly number[] = [];
  const end = performance.now() + 60_000;
  do {
    await delay(200);
    found = (await screenOf(element)).at(60, 50);
  } while (color.some((value, i) => Math.abs(found[i] - (value ?? found[i])) > 3) && performance.now() < end);
  assert(performance.now() < end, `pixel ${found.join(' ')} in the end, expected ${color.join(' ')}`);
}

beforeEach(() => hurry(3));

describe('a post-processor in the element', () => {
  it('that takes depth and the eye gets those of the frame, also of another one', async () => {
    const style = STYLE.replace('white', 'black');
    const element = await showLoaded(
      { src: BALL, 'camera-target': '0m 0m 0m', 'camera-orbit': '0deg 90deg 6m' },
      style,
    );
    const plain = (await screenOf(element)).at(60, 50);
    element.setAttribute('postprocess', `${FIXTURES}post-seen.onnx`);
    // A tenth of the depth as red: half of the light is gone behind the middle of the ball. A tenth of the eye's -z as blue.
    await untilPixel(element, [178, plain[1], 153]);
    element.setAttribute('camera-orbit', '0deg 90deg 5m');
    element.jumpCameraToGoal();
    await untilPixel(element, [152, undefined, 127]);
    // A mesh beside the ball brings a depth of its own, which hides splats and does not replace theirs.
    const box = document.createElement('splat-mesh') as SplatMeshElement;
    Object.assign(box, { src: boxGlb({ half: [0.1, 0.1, 0.1] }), position: [0, 1.6, 0] });
    element.append(box);
    await until(() => box.loaded, `the mesh, with ${box.error?.message ?? ''}`);
    element.setAttribute('camera-orbit', '0deg 90deg 6m');
    element.jumpCameraToGoal();
    await untilPixel(element, [178, plain[1], 153]);
    element.remove();
  });

  it('that keeps a state converges at rest, and then rests', async () => {
    const element = await showLoaded({ src: COMPASS }, STYLE);
    const plain = await lightOf(element);
    const bytes = element.stats!.bytes.frames;
    element.setAttribute('postprocess', `${FIXTURES}post-temporal.onnx`);
    await until(() => element.stats!.bytes.frames > bytes, 'the post-processor');
    // One run alone is a fifth of the light; the model draws 32 x 24 pixels, and the page behind is white.
    await delay(2500);
    let { mean } = await lightOf(element);
    for (const end = performance.now() + 15_000; Math.abs(mean - plain.mean) >= 3 && performance.now() < end;) {
      await delay(200);
      ({ mean } = await lightOf(element));
    }
    assert(Math.abs(mean - plain.mean) < 3, `light ${mean} in the end, ${plain.mean} as drawn`);
    let before = -1;
    for (const end = performance.now() + 30_000; calls.createBindGroup !== before && performance.now() < end;) {
      before = calls.createBindGroup;
      await delay(500);
    }
    assertEqual(calls.createBindGroup, before, 'calls at rest');
  });
});
