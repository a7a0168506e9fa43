/** Shapes and roles of real models on the GPU; a model that continues from its output; the element's report of inputs, and its panel. */
import '@gaussian-splat/element';
import { GaussianSplatElement } from '@gaussian-splat/element';
import type { SplatSceneElement } from '@gaussian-splat/element/scenes.js';
import { Generator } from '@gaussian-splat/generator';
import {
  assert,
  assertEqual,
  COMPASS,
  nextEvent,
  show,
  showLoaded,
  until,
} from '../../element/browser/support/harness.js';
import { CAMERA, FIXTURES, makeDevice, numbersOf, ReadingSink, relativeError, runOnCpu } from './support.js';

GaussianSplatElement.runtimeLocation = '/node_modules/onnxruntime-web/dist/';

it('batches, matrices, a camera to world and a count of 64 bits: the numbers of the CPU, on the GPU', async () => {
  const device = await makeDevice();
  const sink = new ReadingSink(device);
  const url = `${FIXTURES}shaped.onnx`;
  const generator = await Generator.open({ url }, device, { onError: reportError, gpuCheck: false });
  generator.sink = sink;
  const c = Math.cos(1);
  const s = Math.sin(1);
  const camera = { ...CAMERA, worldToCamera: [c, 0, s, 1, 0, 1, 0, 2, -s, 0, c, 5, 0, 0, 0, 1] as const };
  const pose = [0, 1, 0, -1, 0, 0, 0, 0, 1, 1, 0, 0, 0, 1, 0, 0, 0, 1];
  for (const state of [{ camera: CAMERA }, { camera, pose, timeSeconds: 1 }]) {
    generator.request(state);
    await generator.idle;
    const wanted = await runOnCpu(url, state);
    const { rows, tensors } = sink.runs.at(-1)!;
    assertEqual(rows, 64, 'rows of the tensors');
    for (const name of ['means', 'covs', 'rgba', 'alpha']) {
      const { values } = wanted[name];
      const found = numbersOf(await tensors[name], 'float32').slice(0, values.length);
      assert(relativeError(found, values) < 1e-4, `${name}: ${relativeError(found, values)}`);
    }
    assertEqual((await tensors.alive)[0], 40, 'living rows');
  }
  const { layout } = generator.model;
  assertEqual([layout.capacity, layout.paddedRows, layout.countDtype], [48, 64, 'int64']);
  generator.close();
});

it('a model continues from the outputs of its last run, and starts again when the time goes back', async () => {
  const device = await makeDevice();
  const sink = new ReadingSink(device);
  const url = `${FIXTURES}state.onnx`;
  const generator = await Generator.open({ url }, device, { onError: reportError, gpuCheck: false });
  generator.sink = sink;
  const nexts: number[] = [];
  for (const state of [
    { timeSeconds: 0 },
    { timeSeconds: 1 },
    { timeSeconds: 2, controls: { push: 1 } },
    { timeSeconds: 0 },
  ]) {
    generator.request(state);
    await generator.idle;
    nexts.push(numbersOf(await sink.runs.at(-1)!.tensors.next, 'float32')[0]);
  }
  assertEqual(nexts, [0.75, 1, 2, 0.75]);
  assertEqual(generator.kind, 'captured', 'kind: each run of the start begins with the same state');
  generator.close();
});

describe('inputs of models, reported to the page', () => {
  it('inputs, an event when they are others, and none of a scene file', async () => {
    const element = show({ src: `${FIXTURES}state.onnx` });
    let reported = 0;
    element.addEventListener('inputs-change', () => reported++);
    await element.ready;
    await until(() => reported === 1, 'the event');
    assertEqual(element.inputs, [
      { label: 'time', unit: 'seconds', name: 'time', role: 'time', size: 1 } as never,
      { label: 'Push', range: [0, 1], default: 0.25, step: 0.25, name: 'push', role: 'control', size: 1 },
    ]);
    element.src = `${FIXTURES}shaped.onnx`;
    await until(() => element.inputs.some(({ name }) => name === 'pose'), 'the pose');
    const pose = element.inputs.find(({ name }) => name === 'pose');
    assertEqual([pose?.format, pose?.joints, pose?.parents, pose?.size], ['matrix', ['hip', 'knee'], [-1, 0], 18]);
    const gone = nextEvent(element, 'inputs-change');
    element.src = null;
    await gone;
    assertEqual(element.inputs.length, 0, 'inputs without a scene');
    element.src = COMPASS;
    await until(() => element.loaded && element.inputs.length === 0, 'no inputs');
  });

  it('a panel of controls: sliders by their names, joints, a reset, and gone with its attribute', async () => {
    const element = await showLoaded({ src: `${FIXTURES}state.onnx`, 'controls-panel': '' });
    const part = (name: string): HTMLElement | null => element.shadowRoot!.querySelector(`[part=${name}]`);
    await until(() => part('controls-panel') !== null, 'the panel');
    const labels = (): string[] =>
      [...element.shadowRoot!.querySelectorAll('[part=control-label]')].map(({ textContent }) => textContent);
    assertEqual(labels(), ['Time', 'Push']);
    const slider = element.shadowRoot!.querySelectorAll<HTMLInputElement>('[part=control-input]')[1];
    assertEqual(
      [slider.value, slider.min, slider.max, slider.step, slider.labels?.length],
      ['0.25', '0', '1', '0.25', 1],
    );
    slider.value = '0.75';
    slider.dispatchEvent(new Event('input'));
    assertEqual(element.inputValues, { push: [0.75] });
    part('controls-panel')!.querySelector('button')!.click();
    assertEqual(element.inputValues, null);
    element.src = `${FIXTURES}shaped.onnx`;
    await until(() => labels().includes('Joint'), 'the joints');
    const fields = element.shadowRoot!.querySelectorAll<HTMLInputElement>('[part=control-input]');
    fields[2].value = String(Math.PI / 2);
    fields[2].dispatchEvent(new Event('input'));
    const pose = element.pose as readonly number[];
    assertEqual(pose.length, 18);
    assert(
      Math.abs(pose[4]) < 0.01 && Math.abs(pose[5] + 1) < 0.01,
      `a quarter turn around x: ${pose.slice(0, 9).join(' ')}`,
    );
    const resets = (): string => part('controls-panel')!.querySelector('button')!.textContent;
    assertEqual(resets(), 'Reset', 'in English');
    element.a11y = JSON.stringify({ 'controls-reset': 'Back' });
    await until(() => resets() === 'Back', 'the words of the page');
    element.removeAttribute('controls-panel');
    await until(() => part('controls-panel')!.hidden === true, 'no panel');
    const german = await showLoaded({ src: `${FIXTURES}state.onnx`, 'controls-panel': '', lang: 'de' });
    await until(
      () => german.shadowRoot!.querySelector('[part=controls-panel] summary')?.textContent === 'Regler',
      'the words of the language',
    );
  });

  it('a panel shows what the page sets, and turns the pose that there is', async () => {
    const element = await showLoaded({ src: `${FIXTURES}state.onnx`, 'controls-panel': '', 'control-push': '0.5' });
    const fields = (): HTMLInputElement[] => [
      ...element.shadowRoot!.querySelectorAll<HTMLInputElement>('input[part=control-input]'),
    ];
    const shows = (values: string[], at: number): Promise<void> =>
      until(
        () =>
          String(
            fields()
              .map(({ value }) => Number(value).toFixed(1))
              .slice(at),
          ) === String(values),
        `${String(values)} in the panel`,
      );
    await shows(['0.5'], 1);
    element.setAttribute('control-push', '1');
    await shows(['1.0'], 1);
    element.inputValues = { push: 0.25 };
    await shows(['0.3'], 1);
    // Two joints as matrices: the first turned around z, by an attribute.
    element.setAttribute('pose', '0 -1 0 1 0 0 0 0 1 1 0 0 0 1 0 0 0 1');
    element.src = `${FIXTURES}shaped.onnx`;
    await shows(['0.0', '0.0', '1.6'], -3);
    const [, y] = fields().slice(-3);
    y.value = '0';
    y.dispatchEvent(new Event('input'));
    const pose = element.pose as readonly number[];
    assert(Math.abs(pose[0]) < 0.02 && Math.abs(pose[1] + 1) < 0.02, `still turned: ${pose.slice(0, 9).join(' ')}`);
    element.shadowRoot!.querySelector<HTMLElement>('[part=controls-panel] button')!.click();
    assertEqual(element.pose, element.getAttribute('pose'), 'back to what the page gave');
    await shows(['0.0', '0.0', '1.6'], -3);
    element.pose = null;
    await shows(['0.0', '0.0', '0.0'], -3);
  });

  it('the same of a generator in a child: its own inputs, and a group of the panel', async () => {
    const element = await showLoaded({ src: COMPASS, 'controls-panel': '' });
    const child = document.createElement('splat-scene') as SplatSceneElement;
    child.title = 'Ball';
    child.setAttribute('src', `${FIXTURES}state.onnx`);
    const reported = nextEvent(child, 'inputs-change');
    element.append(child);
    await reported;
    assertEqual([child.inputs.map(({ name }) => name).includes('push'), element.inputs.length], [true, 0]);
    const group = (): HTMLElement | null => element.shadowRoot!.querySelector('[part=controls-group]');
    await until(() => group() !== null, 'its group');
    assertEqual(group()!.querySelector('legend')!.textContent, 'Ball');
    const slider = group()!.querySelector<HTMLInputElement>('input[type=range]')!;
    slider.value = '0.75';
    slider.dispatchEvent(new Event('input'));
    assertEqual([child.inputValues, element.inputValues], [{ push: [0.75] }, null]);
    element.shadowRoot!.querySelector<HTMLElement>('[part=controls-panel] button')!.click();
    assertEqual(child.inputValues, null);
    child.remove();
    const panel = element.shadowRoot!.querySelector<HTMLElement>('[part=controls-panel]')!;
    await until(() => panel.hidden === true, 'no panel');
    assertEqual(child.inputs, []);
  });
});
