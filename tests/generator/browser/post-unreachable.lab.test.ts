import '@gaussian-splat/element';
import { GaussianSplatElement, type ElementError } from '@gaussian-splat/element';
import {
  assert,
  assertEqual,
  COMPASS,
  delay,
  nextEvent,
  showLoaded,
  submits,
} from '../../element/browser/support/harness.js';
import { FIXTURES } from './support.js';

GaussianSplatElement.runtimeLocation = '/nowhere/';

let requests = 0;
const { fetch } = globalThis;
globalThis.fetch = (input, init) => {
  if (String(input).includes('/nowhere/')) requests++;
  return fetch(input, init);
};

describe('a post-processor whose runtime cannot be had', () => {
  it('is reported once, costs nothing afterwards, and is tried again when something changes', async () => {
    const element = await showLoaded({ quality: 'default' });
    const reported: ElementError[] = [];
    element.addEventListener('generator-error', ({ detail }) => reported.push(detail));
    const first = nextEvent(element, 'generator-error');
    element.setAttribute('postprocess', `${FIXTURES}post.onnx`);
    await first;
    await delay(300);
    assertEqual(requests, 1, 'requests');
    const frames = submits;
    await delay(1500);
    assertEqual(requests, 1, 'requests');
    assertEqual(submits, frames, 'frames');
    assertEqual([reported.length, reported[0].code], [1, 'network']);
    assert(element.loaded && element.src === COMPASS, 'the scene stays');
    element.setAttribute('camera-orbit', '30deg 75deg auto');
    element.jumpCameraToGoal();
    await delay(1500);
    assertEqual(requests, 2, 'requests');
  });
});
