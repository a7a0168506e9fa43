/** A video as the image of a generator, as that of a webcam: its later frames follow, until the page sets another image. */
import '@gaussian-splat/element';
import { GaussianSplatElement } from '@gaussian-splat/element';
import { assert, assertEqual, delay, hurry, showLoaded, until } from '../../element/browser/support/harness.js';
import { screenOf } from '../../element/browser/support/screen.js';
import { FIXTURES, RUNTIME } from './support.js';

GaussianSplatElement.runtimeLocation = RUNTIME;

/** A playing video of one color, which `paint` changes. */
async function coloredVideo(): Promise<{ video: HTMLVideoElement; paint: (color: string) => void; stop: () => void }> {
  const canvas = Object.assign(document.createElement('canvas'), { width: 32, height: 32 });
  const context = canvas.getContext('2d')!;
  let current = 'rgb(255 0 0)';
  const draw = (): void => {
    context.fillStyle = current;
    context.fillRect(0, 0, 32, 32);
  };
  draw();
  // Without drawing, the stream of a canvas has no frames.
  const timer = setInterval(draw, 50);
  const video = document.createElement('video');
  video.muted = true;
  video.srcObject = canvas.captureStream(20);
  await video.play();
  const stop = (): void => {
    clearInterval(timer);
    video.srcObject = null;
  };
  return { video, paint: (color) => (current = color), stop };
}

async function untilColor(element: GaussianSplatElement, strong: 0 | 1 | 2, what: string): Promise<void> {
  await until(async () => {
    await delay(100);
    const color = (await screenOf(element)).at(40, 40);
    return [0, 1, 2].every((i) => (i === strong ? color[i] > 150 : color[i] < 80));
  }, what);
}

beforeEach(() => hurry(3));

describe('a generator of an image', () => {
  it('follows the frames of a video, and none of it once the page has set another image', async () => {
    const { video, paint, stop } = await coloredVideo();
    const attributes = { 'camera-target': '0m 0m 0m', 'camera-orbit': '0deg 90deg 2m' };
    const style = 'width: 80px; height: 80px; background: black';
    const failed: string[] = [];
    const loading = showLoaded({ src: `${FIXTURES}picture.onnx`, ...attributes }, style);
    const element = document.querySelector('gaussian-splat')!;
    element.addEventListener('generator-error', ({ detail }) => failed.push(detail.message));
    element.inputValues = { image: video };
    await loading;
    await untilColor(element, 0, 'a red frame');
    paint('rgb(0 0 255)');
    await untilColor(element, 2, 'the blue frame');
    paint('rgb(0 255 0)');
    await untilColor(element, 1, 'the green frame');
    const still = document.createElement('canvas');
    Object.assign(still, { width: 8, height: 8 });
    const context = still.getContext('2d')!;
    context.fillStyle = 'rgb(255 0 0)';
    context.fillRect(0, 0, 8, 8);
    element.inputValues = { image: still };
    await untilColor(element, 0, 'the canvas');
    paint('rgb(0 0 255)');
    await delay(1000);
    const color = (await screenOf(element)).at(40, 40);
    assert(color[0] > 150 && color[2] < 80, `the canvas remains: ${color.join(' ')}`);
    assertEqual(failed, [], 'errors');
    stop();
    element.remove();
  });
});
