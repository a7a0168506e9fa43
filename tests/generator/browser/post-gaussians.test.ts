/** Post-processors that take the Gaussians of the frame's generator beside the frame. */
import '@gaussian-splat/element';
import { GaussianSplatElement, type ElementError } from '@gaussian-splat/element';
import {
  assert,
  assertEqual,
  COMPASS,
  delay,
  hurry,
  showLoaded,
  until,
} from '../../element/browser/support/harness.js';
import { screenOf } from '../../element/browser/support/screen.js';
import { FIXTURES, RUNTIME } from './support.js';

GaussianSplatElement.runtimeLocation = RUNTIME;

const BALL = `${FIXTURES}packed.onnx`;
const STYLE = 'width: 60px; height: 50px; background: black';
/** Largest coordinates of the ball at time 0, halved, in 0..255: see `reached` of make.py. */
const REST = [125, 126, 126];

/** Waits until the middle of the frame has a color. */
async function untilMiddle(element: GaussianSplatElement, color: readonly number[], what: string): Promise<void> {
  let found: readonly number[] = [];
  await until(
    async () => {
      await delay(200);
      found = (await screenOf(element)).at(30, 25);
      return color.every((value, i) => Math.abs(found[i] - value) <= 3);
    },
    `${what}: ${color.join(' ')}`,
  ).catch((error: unknown) => {
    throw new Error(`${String(error)}, found ${found.join(' ')}`);
  });
}

beforeEach(() => hurry(3));

describe('a post-processor that takes Gaussians', () => {
  it('gets those of each run of the generator, and of the next one', async () => {
    const element = await showLoaded(
      { src: BALL, 'camera-target': '0m 0m 0m', 'camera-orbit': '0deg 90deg 4m' },
      STYLE,
    );
    element.pause();
    element.currentTime = 0;
    element.setAttribute('postprocess', `${FIXTURES}post-reached.onnx`);
    await untilMiddle(element, REST, 'at rest');
    // A tenth larger: the sine of the time is 1.
    element.currentTime = Math.PI / 2;
    await untilMiddle(
      element,
      REST.map((value) => 1.1 * value),
      'at its largest',
    );
    element.remove();
  });

  it('reports a scene without a generator, shows its frames, and takes that of the next scene', async () => {
    const reported: ElementError[] = [];
    const element = await showLoaded({ src: COMPASS }, STYLE);
    const plain = (await screenOf(element)).at(30, 25);
    element.addEventListener('generator-error', ({ detail }) => reported.push(detail));
    element.setAttribute('postprocess', `${FIXTURES}post-reached.onnx`);
    await until(() => reported.length > 0, 'a report');
    await delay(1500);
    assertEqual(reported.length, 1, reported.map(({ message }) => message).join('; '));
    assertEqual(reported[0].reason, 'contract/chain', reported[0].message);
    assert(/a post-processor follows a generator/.test(reported[0].message), reported[0].message);
    assertEqual((await screenOf(element)).at(30, 25), plain, 'the frame as drawn');
    element.pause();
    element.setAttribute('src', BALL);
    element.setAttribute('camera-target', '0m 0m 0m');
    element.setAttribute('camera-orbit', '0deg 90deg 4m');
    await until(() => element.loaded, 'the generator');
    element.currentTime = 0;
    await untilMiddle(element, REST, 'the generator');
    element.remove();
  });
});
