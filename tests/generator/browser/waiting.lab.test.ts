/** A generator that takes an image waits for it: the page sees its inputs, and the first image shows the scene. */
import '@gaussian-splat/element';
import { GaussianSplatElement } from '@gaussian-splat/element';
import { assert, assertEqual, delay, gated, hurry, show, until } from '../../element/browser/support/harness.js';
import { screenOf } from '../../element/browser/support/screen.js';
import { FIXTURES, RUNTIME } from './support.js';

GaussianSplatElement.runtimeLocation = RUNTIME;

beforeEach(() => hurry(3));

async function redImage(): Promise<Blob> {
  const canvas = new OffscreenCanvas(8, 8);
  const context = canvas.getContext('2d')!;
  context.fillStyle = 'red';
  context.fillRect(0, 0, 8, 8);
  return canvas.convertToBlob();
}

const EVENTS = ['error', 'generator-error', 'load', 'inputs-change', 'preview'] as const;

function listen(element: GaussianSplatElement): string[] {
  const reported: string[] = [];
  for (const type of EVENTS) element.addEventListener(type, () => reported.push(type));
  return reported;
}

for (const [how, set] of [
  [
    'an attribute',
    (element: GaussianSplatElement, image: Blob): void =>
      element.setAttribute('control-image', URL.createObjectURL(image)),
  ],
  ['a script', (element: GaussianSplatElement, image: Blob): void => void (element.inputValues = { image })],
] as const) {
  it(`shows its inputs and a panel without an image, fails in nothing, and loads with the image that ${how} sets`, async () => {
    const element = show({ src: `${FIXTURES}picture.onnx`, 'controls-panel': '' });
    const reported = listen(element);
    await until(() => element.inputs.length > 0, 'inputs');
    assertEqual(
      element.inputs.map(({ name, role }) => [name, role]),
      [['image', 'image']],
      'inputs',
    );
    await until(() => element.shadowRoot?.querySelector('input[type=file]') !== null, 'a field for the image');
    await delay(300);
    assertEqual([element.loaded, element.error], [false, null], 'loaded, error');
    set(element, await redImage());
    await element.ready;
    assert(element.loaded, String(element.error?.message));
    await until(() => reported.includes('load'), 'load');
    assertEqual([reported.includes('error'), reported.includes('generator-error')], [false, false], reported.join());
    assertEqual(element.stats?.splats, 64, 'splats');
    const red = (await screenOf(element)).middleOf(([r, g, b]) => r > 100 && g < 60 && b < 60);
    assert((red?.count ?? 0) > 20, `${red?.count} red pixels`);
    element.remove();
  });
}

it('is left for another scene while it waits', async () => {
  const element = show({ src: `${FIXTURES}picture.onnx` });
  await until(() => element.inputs.length > 0, 'inputs');
  element.src = `${FIXTURES}packed.onnx`;
  await element.ready;
  assertEqual([element.loaded, element.stats?.splats], [true, 64], 'loaded, splats');
  assertEqual(
    element.inputs.map(({ name }) => name),
    ['time'],
    'inputs',
  );
});

it('an image that is replaced before it has arrived neither delays the next one nor is an error', async () => {
  const { src, open } = gated('compass.ply');
  const element = show({ src: `${FIXTURES}picture.onnx` });
  const reported = listen(element);
  await until(() => element.inputs.length > 0, 'inputs');
  element.inputValues = { image: src };
  await delay(300);
  element.inputValues = { image: await redImage() };
  await until(() => element.loaded, 'the scene', 3_000);
  await open();
  await delay(300);
  assertEqual(reported.includes('generator-error'), false, 'errors');
});
