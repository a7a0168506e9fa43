/** Picking: the object that a click, the pointer or the keyboard hits, among scenes and meshes. */
import '@gaussian-splat/element/scenes.js';
import type { GaussianSplatElement } from '@gaussian-splat/element';
import type { ScenePointerEvent, SplatMeshElement, SplatSceneElement } from '@gaussian-splat/element/scenes.js';
import { sendKeys, sendMouse } from '@web/test-runner-commands';
import { itInLab } from '../../support/extent-in-pages.js';
import { violationsIn } from './support/axe.js';
import { boxGlb } from './support/glb.js';
import {
  assert,
  assertEqual,
  atRest,
  COMPASS,
  FIXTURES,
  nextEvent,
  showLoaded,
  submits,
  until,
} from './support/harness.js';

const GREEN = `${FIXTURES}green.splat`;
/** From 10 m on the z axis, 240 x 200 pixels: a meter at the origin is 24.14 pixels. */
const VIEW = {
  ...{ 'camera-orbit': '0deg 90deg 10m', 'camera-target': '0 0 0', 'field-of-view': '45deg', quality: 'default' },
  ...{ 'interpolation-decay': '0', 'interaction-prompt': 'none', alt: 'Balls and a box' },
};
const METER = 100 / Math.tan(Math.PI / 8) / 10;
const at = (x: number, y: number): [number, number] => [Math.round(120 + x * METER), Math.round(100 - y * METER)];

interface Shown {
  readonly element: GaussianSplatElement;
  readonly ball: SplatSceneElement;
  readonly box: SplatMeshElement;
}

async function shown(attributes: Readonly<Record<string, string>> = {}): Promise<Shown> {
  document.body.style.margin = '0';
  const ball = document.createElement('splat-scene') as SplatSceneElement;
  const box = document.createElement('splat-mesh') as SplatMeshElement;
  Object.assign(ball, { src: GREEN, position: [3, 2, 0], interactive: true, ariaLabel: 'The green ball' });
  Object.assign(box, { src: boxGlb({ half: [0.5, 0.5, 0.5], names: ['Seat', 'Oak'] }), position: [-3, 2, 0] });
  Object.assign(box, { interactive: true, ariaLabel: 'The box' });
  const element = await showLoaded({ src: COMPASS, ...VIEW, ...attributes }, 'width: 240px; height: 200px');
  element.append(ball, box);
  await until(() => ball.loaded && box.loaded, `both, with ${box.error?.message ?? ''}`);
  await until(() => buttons(element).length === 2, 'the code of clicks');
  await atRest(element);
  return { element, ball, box };
}

const buttons = (element: Element): HTMLButtonElement[] => [
  ...element.shadowRoot!.querySelectorAll<HTMLButtonElement>('[part=scene-button]'),
];

const click = async (x: number, y: number): Promise<void> => {
  await sendMouse({ type: 'move', position: at(x, y) });
  await sendMouse({ type: 'down' });
  await sendMouse({ type: 'up' });
};

afterEach(() => sendMouse({ type: 'move', position: [700, 500] }));

describe('positionFromPoint', () => {
  it('reports the owner of a surface: the own scene and its splat, a child, a mesh and its material', async () => {
    const { element, ball, box } = await shown();
    const own = await element.positionFromPoint(...at(1, 0));
    assert(own?.element === element, `the own scene, not ${own?.element.localName}`);
    assert(own.splat !== null && own.splat >= 0 && own.mesh === null, `splat ${own.splat}`);
    assert(Math.abs(own.distance - Math.hypot(1, 10)) < 0.3, `${own.distance} m`);
    const green = await element.positionFromPoint(...at(3, 2));
    assert(green?.element === ball && green.splat !== null, 'the child');
    const wood = await element.positionFromPoint(...at(-3, 2));
    assert(wood?.element === box, `the mesh, not ${wood?.element.localName}`);
    assertEqual([wood.mesh, wood.material, wood.splat], ['Seat', 'Oak', null], 'names of the file');
  });

  itInLab('finds a mesh where a bone has moved it', async () => {
    document.body.style.margin = '0';
    const element = await showLoaded({ src: COMPASS, ...VIEW }, 'width: 240px; height: 200px');
    const box = document.createElement('splat-mesh') as SplatMeshElement;
    const src = boxGlb({ half: [0.5, 0.5, 0.5], moves: 6, isSkinned: true });
    Object.assign(box, { src, position: [-3, 2, 0], loop: true });
    element.append(box);
    await until(() => box.loaded, `the box, with ${box.error?.message ?? ''}`);
    for (const [time, x] of [
      [0, -3],
      [0.5, 0],
      [0.9, 2.4],
    ] as const) {
      box.currentTime = time;
      await atRest(element);
      const found = await element.positionFromPoint(...at(x, 2));
      assert(found?.element === box, `at ${time} s the box, not ${found?.element.localName}`);
    }
  });

  for (const renderer of ['webgpu', 'webgl'])
    it(`${renderer}: indices of splats are those of the renderer's order`, async () => {
      // Far apart along x: their order is that of the Morton curve, so that each has the number of its place.
      const bytes = new DataView(new ArrayBuffer(32 * 5));
      for (let i = 0; i < 5; i++) {
        [i - 2, 0, 0, 0.2, 0.2, 0.2].forEach((value, k) => bytes.setFloat32(32 * i + 4 * k, value, true));
        [200, 120, 40, 255, 255, 128, 128, 128].forEach((value, k) => bytes.setUint8(32 * i + 24 + k, value));
      }
      const src = `${URL.createObjectURL(new Blob([bytes.buffer]))}#row.splat`;
      document.body.style.margin = '0';
      const element = await showLoaded({ ...VIEW, src, renderer }, 'width: 240px; height: 200px');
      await atRest(element);
      const found: (number | null | undefined)[] = [];
      for (let i = 0; i < 5; i++) found.push((await element.positionFromPoint(...at(i - 2, 0)))?.splat);
      assertEqual(found, [0, 1, 2, 3, 4], 'numbers from left to right');
    });
});

describe('clicks', () => {
  it('come once, to the child that they meet, and bubble', async () => {
    const { element, ball, box } = await shown();
    const seen: [string, EventTarget | null, string | null | undefined][] = [];
    element.addEventListener('click', (event) =>
      seen.push(['element', event.target, (event as ScenePointerEvent).hit?.material]),
    );
    for (const child of [ball, box])
      child.addEventListener('click', (event: Event) =>
        seen.push(['child', event.target, (event as ScenePointerEvent).hit?.material]),
      );
    await click(3, 2);
    await until(() => seen.length === 2, 'the ball');
    await click(-3, 2);
    await until(() => seen.length === 4, 'the box');
    await click(0, -3.5);
    await until(() => seen.length === 5, 'nothing');
    assertEqual(
      seen.map(([who, target, material]) => [who, (target as Element).localName, material]),
      [
        ['child', 'splat-scene', null],
        ['element', 'splat-scene', null],
        ['child', 'splat-mesh', 'Oak'],
        ['element', 'splat-mesh', 'Oak'],
        ['element', 'gaussian-splat', undefined],
      ],
      'who saw what',
    );
  });

  it('are none at the end of a drag', async () => {
    const { element, ball } = await shown({ 'camera-controls': '' });
    let clicks = 0;
    element.addEventListener('click', () => clicks++);
    await sendMouse({ type: 'move', position: at(3, 2) });
    await sendMouse({ type: 'down' });
    await sendMouse({ type: 'move', position: at(2, 2) });
    await sendMouse({ type: 'move', position: at(3, 2) });
    await sendMouse({ type: 'up' });
    await click(3, 2);
    await until(() => clicks > 0, 'the click');
    await new Promise((resolve) => setTimeout(resolve, 200));
    assert(ball.loaded, 'still there');
    assertEqual(clicks, 1, 'clicks');
  });

  it('leave the clicks of elements without such children alone', async () => {
    document.body.style.margin = '0';
    const element = await showLoaded({ src: COMPASS, ...VIEW }, 'width: 240px; height: 200px');
    await atRest(element);
    const before = submits;
    const seen = nextEvent<MouseEvent>(element, 'click');
    await click(1, 0);
    assert((await seen).isTrusted, "the browser's own");
    assertEqual(submits - before, 0, 'questions to the GPU');
  });
});

describe('the pointer', () => {
  it('is over one child at a time, with its cursor, and asks the GPU only when it moves', async () => {
    const { element, ball, box } = await shown();
    box.style.cursor = 'help';
    const seen: string[] = [];
    for (const type of ['pointerover', 'pointerout'])
      element.addEventListener(type, (event) => {
        if (event.target !== element) seen.push(`${type} ${(event.target as Element).localName}`);
      });
    const { style } = element.shadowRoot!.querySelector<HTMLElement>('#view')!;
    await sendMouse({ type: 'move', position: at(3, 2) });
    await until(() => seen.length === 1, 'over the ball');
    assertEqual(style.cursor, 'pointer', 'cursor over the ball');
    await sendMouse({ type: 'move', position: at(-3, 2) });
    await until(() => seen.length === 3, 'over the box');
    assertEqual(style.cursor, 'help', 'cursor over the box');
    await new Promise((resolve) => setTimeout(resolve, 400));
    const before = submits;
    await new Promise((resolve) => setTimeout(resolve, 400));
    assertEqual(submits - before, 0, 'questions of a pointer that rests');
    await sendMouse({ type: 'move', position: [700, 500] });
    await until(() => seen.length === 4, 'away');
    assertEqual(style.cursor, '', 'cursor beside it');
    const expected = [
      'pointerover splat-scene',
      'pointerout splat-scene',
      'pointerover splat-mesh',
      'pointerout splat-mesh',
    ];
    assertEqual(seen, expected, 'events');
    ball.interactive = false;
    await until(() => buttons(element).length === 1, 'one button');
  });
});

describe('the keyboard', () => {
  it('reaches each child, shows which, and clicks it; axe finds nothing', async () => {
    const { element, ball } = await shown({ 'camera-controls': '' });
    const [first] = buttons(element);
    assertEqual(first.ariaLabel, 'The green ball', 'name');
    element.focus();
    const focused = nextEvent(ball, 'focus');
    await sendKeys({ press: 'Tab' });
    await focused;
    assert(element.shadowRoot!.activeElement === first, 'the focus');
    const { left, top, width, height } = first.getBoundingClientRect();
    const [x, y] = at(3, 2);
    assert(
      left < x && left + width > x && top < y && top + height > y && width < 120,
      `a box of ${width} px around it`,
    );
    const clicked = nextEvent<ScenePointerEvent>(ball, 'click');
    await sendKeys({ press: 'Enter' });
    assertEqual((await clicked).hit, null, 'what a key meets');
    assertEqual(await violationsIn(element), [], 'axe');
  });
});
