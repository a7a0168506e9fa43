/** Walking on a floor that the element finds in the splats. */
import '@gaussian-splat/element/scenes.js';
import type { GaussianSplatElement } from '@gaussian-splat/element';
import type { SplatSceneElement } from '@gaussian-splat/element/scenes.js';
import { emulateMedia } from '@web/test-runner-commands';
import {
  assert,
  assertEqual,
  atRest,
  claimComing,
  delay,
  FIXTURES,
  frames,
  nextEvent,
  show,
  until,
} from './support/harness.js';

/** Flat splats on the floor and walls of a room of `side` by `depth` meters, the floor at height 0: a `.splat` file, y down. */
function room(side: number, unit = 1, depth = side): string {
  const [step, sigma, half] = [0.1, 0.07, side / 2];
  const splats: [number, number, number, number][] = [];
  for (let a = -half; a <= half; a += step)
    for (let b = -half; b <= half; b += step) {
      splats.push([a, 0, b, 1]);
      const height = b + half;
      if (height > 2.4) continue;
      for (const wall of [-half, half]) splats.push([wall, height, a, 0], [a, height, wall, 2]);
    }
  const bytes = new DataView(new ArrayBuffer(32 * splats.length));
  splats.forEach(([x, y, z, flat], i) => {
    [x, -y, (-z * depth) / side].forEach((value, axis) => bytes.setFloat32(32 * i + 4 * axis, value / unit, true));
    for (const axis of [0, 1, 2])
      bytes.setFloat32(32 * i + 12 + 4 * axis, (axis === flat ? 0.005 : sigma) / unit, true);
    const color = flat === 1 ? [200, 60, 60, 250] : [80, 80, 200, 250];
    [...color, 255, 128, 128, 128].forEach((value, k) => bytes.setUint8(32 * i + 24 + k, value));
  });
  return `${URL.createObjectURL(new Blob([bytes.buffer]))}#room.splat`;
}

/** A view of a room of 5 m from outside: a walk begins near the wall, in the direction of -z. */
const OUTSIDE = '0deg 75deg 100%';

async function walkIn(src: string, attributes: Record<string, string> = {}): Promise<GaussianSplatElement> {
  const element = show(
    {
      src,
      navigation: 'walk',
      'camera-controls': '',
      'interpolation-decay': '0',
      'interaction-prompt': 'none',
      'camera-orbit': OUTSIDE,
      ...attributes,
    },
    'width: 200px; height: 160px',
  );
  await nextEvent(element, 'walk-ready');
  return element;
}

/** Eye of the camera, viewer space. */
function eyeOf(element: GaussianSplatElement): [number, number, number] {
  const { theta, phi, radius } = element.getCameraOrbit();
  const { x, y, z } = element.getCameraTarget();
  return [
    x + radius * Math.sin(theta) * Math.sin(phi),
    y + radius * Math.cos(phi),
    z + radius * Math.cos(theta) * Math.sin(phi),
  ];
}

const viewOf = (element: GaussianSplatElement): HTMLElement => element.shadowRoot!.querySelector<HTMLElement>('#view')!;

function press(element: GaussianSplatElement, type: 'keydown' | 'keyup', code: string): void {
  viewOf(element).dispatchEvent(new KeyboardEvent(type, { code, key: code, bubbles: true, cancelable: true }));
}

const near = (actual: number, expected: number, tolerance: number, what: string): void =>
  assert(Math.abs(actual - expected) <= tolerance, `${what}: expected ${expected}, found ${actual}`);

describe('navigation="walk"', () => {
  it('stands on the floor at the height of the eyes, walks by keys and stops at walls, which are said once', async () => {
    const element = await walkIn(room(5));
    near(eyeOf(element)[1], 1.6, 0.03, 'height of the eyes');
    near(element.getCameraOrbit().phi, Math.PI / 2, 1e-6, 'it looks straight ahead');
    const [x, , z] = eyeOf(element);
    press(element, 'keydown', 'KeyW');
    const status = (): string => element.shadowRoot!.querySelector('[role="status"]')!.textContent;
    await until(() => status() === 'Blocked', 'the wall');
    const texts = new Set<string>();
    const seen = new MutationObserver(() => texts.add(status()));
    seen.observe(element.shadowRoot!, { subtree: true, characterData: true, childList: true });
    await delay(300);
    press(element, 'keyup', 'KeyW');
    seen.disconnect();
    assertEqual([...texts].filter((text) => text === 'Blocked').length <= 1, true, 'said once');
    const [toX, toY, toZ] = eyeOf(element);
    near(toY, 1.6, 0.05, 'height at the wall');
    near(toX, x, 0.1, 'straight ahead');
    assert(z - toZ > 1, `it walked ${z - toZ} m`);
    assert(toZ > -2.35 && toZ < -1.9, `it stopped at ${toZ}, the wall is at -2.5`);
    // Idle pages draw nothing.
    await atRest(element);
  });

  it('looks along a long room first, unless camera-orbit has a direction', async () => {
    const long = room(8, 1, 2.5);
    for (const orbit of ['auto auto 100%', 'auto']) {
      const { theta } = (await walkIn(long, { 'camera-orbit': orbit })).getCameraOrbit();
      near(Math.abs(Math.sin(theta)), 1, 0.1, `along x, ${orbit}`);
    }
    const given = await walkIn(long, { 'camera-orbit': '10deg auto auto' });
    near(given.getCameraOrbit().theta, Math.PI / 18, 1e-6, 'the direction of the attribute');
    given.resetCamera();
    await atRest(given);
    near(given.getCameraOrbit().theta, Math.PI / 18, 1e-6, 'the same after a reset');
  });

  it('begins in the room, with the direction of the first view, which is within it, too', async () => {
    const element = show({ src: room(5), 'interaction-prompt': 'none' }, 'width: 200px; height: 160px');
    await element.ready;
    const first = eyeOf(element);
    assert(first.every((value) => Math.abs(value) < 2.4) && first[1] > 0.2, `the first view: ${first.join()}`);
    const { theta } = element.getCameraOrbit();
    const ready = nextEvent(element, 'walk-ready');
    element.setAttribute('navigation', 'walk');
    await ready;
    const [x, y, z] = eyeOf(element);
    near(y, 1.6, 0.03, 'height of the eyes');
    near(Math.hypot(x - first[0], z - first[2]), 0, 1.2, 'beside the first view');
    near(element.getCameraOrbit().theta, theta, 1e-6, 'its direction');
    // A direction of the page does not put the walker outside.
    const given = eyeOf(await walkIn(room(5), { 'camera-orbit': '10deg' }));
    near(Math.hypot(given[0] - x, given[2] - z), 0, 0.05, 'the same place');
  });

  it('turns by the arrow keys and walks to a click on the floor', async () => {
    const element = await walkIn(room(5));
    const { theta } = element.getCameraOrbit();
    press(element, 'keydown', 'ArrowLeft');
    await delay(100);
    press(element, 'keyup', 'ArrowLeft');
    assert(element.getCameraOrbit().theta > theta, 'turned to the left');
    await atRest(element);
    const before = eyeOf(element);
    const { left, top, width, height } = element.getBoundingClientRect();
    const at = { clientX: left + width / 2, clientY: top + 0.95 * height };
    const target = await element.positionFromPoint(at.clientX, at.clientY);
    assert(target && Math.abs(target.y) < 0.1, `a point of the floor: ${target?.toString()}`);
    viewOf(element).dispatchEvent(new MouseEvent('click', { ...at, bubbles: true }));
    const distance = (): number => Math.hypot(eyeOf(element)[0] - target.x, eyeOf(element)[2] - target.z);
    await until(() => distance() < 0.15, 'the place of the click');
    assert(Math.hypot(eyeOf(element)[0] - before[0], eyeOf(element)[2] - before[2]) > 0.3, 'it has walked');
  });

  it('jumps to a click for visitors who prefer reduced motion', async () => {
    await emulateMedia({ reducedMotion: 'reduce' });
    try {
      const element = await walkIn(room(5));
      await atRest(element);
      const { left, top, width, height } = element.getBoundingClientRect();
      const at = { clientX: left + width / 2, clientY: top + 0.95 * height };
      const target = await element.positionFromPoint(at.clientX, at.clientY);
      assert(target, 'a point of the floor');
      const distance = (): number => Math.hypot(eyeOf(element)[0] - target.x, eyeOf(element)[2] - target.z);
      assert(distance() > 0.3, `${distance()} m away`);
      const seen: number[] = [];
      element.addEventListener('camera-change', () => seen.push(distance()));
      viewOf(element).dispatchEvent(new MouseEvent('click', { ...at, bubbles: true }));
      await until(() => distance() < 0.15, 'the place of the click');
      await frames(3);
      assert(seen.length > 0 && seen.every((left) => left < 0.15), `places on the way: ${seen.join()}`);
    } finally {
      await emulateMedia({ reducedMotion: 'no-preference' });
    }
  });

  it('walks to a click beside a child that takes clicks, and not to one on it', async () => {
    const element = show(
      {
        ...{ src: room(5), 'camera-controls': '', 'camera-orbit': OUTSIDE },
        ...{ 'interpolation-decay': '0', 'interaction-prompt': 'none' },
      },
      'width: 200px; height: 160px',
    );
    const ball = document.createElement('splat-scene') as SplatSceneElement;
    Object.assign(ball, { src: `${FIXTURES}green.splat`, position: [0, 1.6, -1.5], scale: 0.3, interactive: true });
    element.append(ball);
    await element.ready;
    const part = (): Element | null => element.shadowRoot!.querySelector('[part=scene-button]');
    await until(() => ball.loaded && part() !== null, 'the code of clicks');
    const ready = nextEvent(element, 'walk-ready');
    element.setAttribute('navigation', 'walk');
    await ready;
    await atRest(element);
    const start = eyeOf(element);
    const { left, top, width, height } = element.getBoundingClientRect();
    const click = (y: number): boolean =>
      viewOf(element).dispatchEvent(
        new MouseEvent('click', { clientX: left + width / 2, clientY: top + y * height, bubbles: true }),
      );
    const away = (): number => Math.hypot(eyeOf(element)[0] - start[0], eyeOf(element)[2] - start[2]);
    const hit = nextEvent(ball, 'click');
    click(0.5);
    await hit;
    await delay(200);
    assert(away() < 0.01, 'a click on the child walks');
    click(0.95);
    await until(() => away() > 0.3, 'a walk');
  });

  it('Home returns to the start, and a walk continues from a view that has moved the camera', async () => {
    const element = await walkIn(room(5));
    const start = eyeOf(element);
    press(element, 'keydown', 'KeyW');
    await until(() => Math.hypot(eyeOf(element)[0] - start[0], eyeOf(element)[2] - start[2]) > 1, 'a walk');
    press(element, 'keyup', 'KeyW');
    await atRest(element);
    press(element, 'keydown', 'Home');
    await frames(4);
    for (const axis of [0, 1, 2]) near(eyeOf(element)[axis], start[axis], 1e-3, `eye after Home, axis ${axis}`);
    near(element.getCameraOrbit().phi, Math.PI / 2, 1e-6, 'it looks straight ahead');
    await element.flyTo({ position: [-1, 1.2, -1], lookAt: [0, 1.2, -1] }, { duration: 0 });
    near(eyeOf(element)[1], 1.2, 1e-6, 'the view');
    press(element, 'keydown', 'KeyW');
    press(element, 'keyup', 'KeyW');
    await frames(4);
    const [x, y, z] = eyeOf(element);
    near(y, 1.6, 0.03, 'height of the eyes');
    near(z, -1, 0.05, 'beside the view');
    assert(x > -1 && x < -0.5, `a step ahead of the view: ${x}`);
  });

  it('has a joystick on touch screens, beside which the ruler has its button', async () => {
    const { matchMedia } = window;
    window.matchMedia = (query) =>
      query === '(pointer: coarse)' ? ({ matches: true } as MediaQueryList) : matchMedia.call(window, query);
    try {
      const element = await walkIn(room(5), { measure: '' });
      const part = (name: string): HTMLElement | null => element.shadowRoot!.querySelector(`[part=${name}]`);
      await until(() => (part('joystick')?.clientWidth ?? 0) > 0 && part('measure-button') !== null, 'both');
      const [stick, button] = ['joystick', 'measure-button'].map((name) => part(name)!.getBoundingClientRect());
      assert(stick.bottom <= button.top, `the joystick ends at ${stick.bottom}, the button begins at ${button.top}`);
      assert(stick.top >= element.getBoundingClientRect().top, 'the joystick is within the scene');
    } finally {
      window.matchMedia = matchMedia;
    }
  });

  it('takes the unit of the file: the same room in units of 50 cm', async () => {
    const element = await walkIn(room(5, 0.5), { unit: '50cm', 'eye-height': '120cm' });
    near(eyeOf(element)[1], 2.4, 0.06, 'eyes, in units of the file');
  });

  it('warns and flies where there is no floor', async () => {
    const element = show(
      { src: room(0.5), navigation: 'walk', 'camera-controls': '', 'interaction-prompt': 'none' },
      'width: 120px; height: 100px',
    );
    await element.ready;
    await claimComing(/navigation="walk".*m².*up and unit.*walk-map/s);
    const before = eyeOf(element);
    // The keys of flight are loaded now.
    await until(() => {
      press(element, 'keydown', 'KeyE');
      press(element, 'keyup', 'KeyE');
      element.jumpCameraToGoal();
      return eyeOf(element)[1] > before[1];
    }, 'flight');
    await frames();
  });
});
