/** Effects of a page on splats: `<splat-cut>`, `reveal-effect` and `splatShader`. */
import { insideOf } from './support/inside.js';
import '@gaussian-splat/element';
import type { GaussianSplatElement } from '@gaussian-splat/element';
import { emulateMedia } from '@web/test-runner-commands';
import { violationsIn } from './support/axe.js';
import {
  assert,
  assertEqual,
  atRest,
  claimComing,
  COMPASS,
  delay,
  FIXTURES,
  frames,
  gated,
  nextEvent,
  showLoaded,
  submits,
  until,
} from './support/harness.js';
import { itInLab } from '../../support/extent-in-pages.js';
import { comesToShow, isBlue, isGreen, isRed, screenOf, type Rgb, type Screen } from './support/screen.js';

const VIEW = {
  'camera-orbit': '0deg 90deg 10m',
  'camera-target': '0 0 0',
  'field-of-view': '45deg',
  quality: 'default',
};

const isColored = (color: Rgb): boolean => isRed(color) || isGreen(color) || isBlue(color);
const countOf = async (element: Element, isPicked: (color: Rgb) => boolean): Promise<number> =>
  (await screenOf(element)).middleOf(isPicked)?.count ?? 0;

/** Adds a cut, and waits until it acts. */
async function cut(parent: Element, attributes: Readonly<Record<string, string>>): Promise<HTMLElement> {
  const child = document.createElement('splat-cut');
  for (const [name, value] of Object.entries(attributes)) child.setAttribute(name, value);
  parent.append(child);
  const element = parent.closest('gaussian-splat')!;
  await customElements.whenDefined('splat-cut');
  await until(() => insideOf(element).sources.world.placements.some(({ modifier }) => modifier), 'the cut acts');
  await frames(3);
  return child;
}

it('a cut hides what is inside or outside, moves without a pipeline or a buffer, and goes again', async () => {
  const element = await showLoaded(VIEW);
  const whole = [await countOf(element, isRed), await countOf(element, isGreen)];
  assert(
    whole.every((count) => count > 0),
    `red and green are seen: ${whole.join()}`,
  );
  const child = (await cut(element, { shape: 'box', scale: '100', position: '50.5 0 0' })) as HTMLElement & {
    position: number[];
  };
  const right = await screenOf(element);
  const hidden = right.middleOf(isColored);
  assert(hidden !== null && hidden.x < 60, 'what is right of the middle is hidden');
  let made = 0;
  const prototypes = [
    [GPUDevice.prototype, 'createBuffer'],
    [GPUDevice.prototype, 'createComputePipeline'],
    [GPUDevice.prototype, 'createComputePipelineAsync'],
    [GPUDevice.prototype, 'createBindGroup'],
  ] as const;
  const before = prototypes.map(([of, name]) => of[name]);
  prototypes.forEach(([of, name], k) => {
    (of as unknown as Record<string, unknown>)[name] = function (this: GPUDevice, ...rest: unknown[]): unknown {
      made++;
      return (before[k] as (...all: unknown[]) => unknown).apply(this, rest);
    };
  });
  try {
    for (let step = 0; step < 5; step++) {
      child.position = [50.5 - step, 0, 0];
      await frames(2);
    }
  } finally {
    prototypes.forEach(([of, name], k) => ((of as unknown as Record<string, unknown>)[name] = before[k]));
  }
  assertEqual(made, 0, 'buffers, bind groups and pipelines made while a cut moves');
  child.setAttribute('side', 'outside');
  child.position = [50.5, 0, 0];
  await frames(3);
  const left = (await screenOf(element)).middleOf(isColored);
  assert(left !== null && left.x > 60, 'now what is left of it is');
  child.remove();
  await frames(3);
  assertEqual([await countOf(element, isRed), await countOf(element, isGreen)].join(), whole.join(), 'all is back');
});

it('picking does not find what a cut hides', async () => {
  const element = await showLoaded(VIEW);
  const middle = (await screenOf(element)).middleOf(isRed)!;
  const { left, top } = element.getBoundingClientRect();
  const pick = (): Promise<unknown> => element.positionFromPoint(left + middle.x, top + middle.y);
  assert((await pick()) !== null, 'red is found');
  await cut(element, { shape: 'sphere', scale: '100' });
  assertEqual(await pick(), null, 'nothing is found');
});

it('a cut in a <splat-scene> is for that scene alone, in its frame', async () => {
  const element = await showLoaded({ ...VIEW, src: `${FIXTURES}green.splat` });
  const child = document.createElement('splat-scene');
  child.setAttribute('src', COMPASS);
  element.append(child);
  await until(() => (child as HTMLElement & { loaded?: boolean }).loaded === true, 'the child');
  assert((await countOf(element, isRed)) > 0, 'red is seen');
  await cut(child, { shape: 'sphere', scale: '100' });
  assertEqual(await countOf(element, isRed), 0, 'red');
  assert((await countOf(element, isGreen)) > 0, 'the element’s own scene stays');
});

itInLab('a cut tints', async () => {
  const element = await showLoaded(VIEW);
  await cut(element, { shape: 'sphere', scale: '100', effect: 'recolor', hue: '120deg' });
  assert((await countOf(element, isRed)) === 0 || (await countOf(element, isGreen)) > 0, 'hues are turned');
  await cut(element, { shape: 'sphere', scale: '100', effect: 'tint', color: 'white' });
  assertEqual(await countOf(element, isColored), 0, 'shades of gray');
});

itInLab('a scene appears by the progress of the page, and by time', async () => {
  const element = await showLoaded({ ...VIEW, 'reveal-effect': 'fade' });
  element.revealProgress = 0;
  await frames(4);
  assertEqual(await countOf(element, isColored), 0, 'nothing at 0');
  element.revealProgress = 1;
  await frames(4);
  const whole = await countOf(element, isColored);
  assert(whole > 0, 'all at 1');
  for (const effect of ['grow', 'sweep x', 'detail']) {
    element.setAttribute('reveal-effect', effect);
    element.revealProgress = 0.3;
    await frames(4);
    const part = await screenOf(element);
    element.revealProgress = 1;
    await frames(4);
    assert((await screenOf(element)).differences(part, 8) > 0, `${effect} is seen on the way`);
    assertEqual(await countOf(element, isColored), whole, `${effect} ends with all of it`);
  }
  const timed = await showLoaded({ ...VIEW, 'reveal-effect': 'sweep x 300ms' });
  // A page that does not scroll computes 0 / 0.
  timed.revealProgress = NaN;
  await delay(600);
  await atRest(timed);
  assertEqual(await countOf(timed, isColored), whole, 'after its time');
  // The scene that is shown stays as it is until the next one has loaded, which then appears from its beginning.
  const { src, open } = gated('compass.ply');
  timed.setAttribute('reveal-effect', 'fade 3600s');
  timed.src = src;
  await nextEvent(timed, 'loadstart');
  await frames(4);
  assertEqual(await countOf(timed, isColored), whole, 'while the next one loads');
  const loaded = nextEvent(timed, 'load');
  await open();
  await loaded;
  await frames(4);
  assertEqual(await countOf(timed, isColored), 0, 'at the beginning of the next one');
});

it('a function of the page changes splats; a wrong one is reported by its line, and the scene stays', async () => {
  const element = await showLoaded(VIEW);
  const whole = await countOf(element, isColored);
  const reported = nextEvent<CustomEvent<{ code: string; message: string }>>(element, 'shader-error');
  const { warn } = console;
  console.warn = () => undefined;
  element.splatShader = {
    code: 'fn modify(splat: Splat, uniforms: Uniforms) -> Splat {\n  var s = splat;\n  s.paint = vec3f(0.0);\n  return s;\n}',
  };
  const { detail } = await reported;
  console.warn = warn;
  assertEqual(detail.code, 'argument/splat-shader', 'code');
  assert(detail.message.includes('in line 3'), detail.message);
  assertEqual(await countOf(element, isColored), whole, 'the scene without it');
  const gray = (by: string): string =>
    `fn helper(c: vec3f) -> vec3f { return vec3f(dot(c, vec3f(0.333))); }
    fn modify(splat: Splat, uniforms: Uniforms) -> Splat { var s = splat; s.color = mix(s.color, helper(s.color), uniforms.amount)${by}; return s; }`;
  element.splatShader = { code: gray(''), uniforms: { amount: 1 } };
  assert(await comesToShow(element, (screen) => screen.middleOf(isColored) === null), 'gray');
  element.splatShader = { code: gray(''), uniforms: { amount: 0 } };
  await frames(4);
  assertEqual(await countOf(element, isColored), whole, 'the values alone are others');
  // 1 / 0 and 0 / 0 in all that it returns.
  element.splatShader = {
    code: `fn modify(splat: Splat, uniforms: Uniforms) -> Splat { let x = 1.0 / uniforms.zero; return Splat(splat.position + vec3f(x), vec3f(x - x), x - x, x); }`,
    uniforms: { zero: 0 },
  };
  await delay(1500);
  await frames(4);
  assert(element.loaded && element.error === null, 'the device is still there');
  element.splatShader = null;
  await frames(4);
  assertEqual(await countOf(element, isColored), whole, 'without it all is as before');
});

itInLab('functions of two elements that are compiled at the same time stay apart', async () => {
  const elements = await Promise.all([showLoaded(VIEW), showLoaded(VIEW)]);
  const painted = (color: string): string =>
    `fn modify(splat: Splat, uniforms: Uniforms) -> Splat { var s = splat; s.color = vec3f(${color}); return s; }`;
  elements[0].splatShader = { code: painted('1.0, 0.0, 0.0') };
  elements[1].splatShader = { code: painted('0.0, 0.0, 1.0') };
  const only = (isPicked: (color: Rgb) => boolean): ((screen: Screen) => boolean) => {
    const others = [isRed, isGreen, isBlue].filter((each) => each !== isPicked);
    return (screen) => screen.middleOf(isPicked) !== null && others.every((each) => screen.middleOf(each) === null);
  };
  assert(await comesToShow(elements[0], only(isRed)), 'the first is red');
  assert(await comesToShow(elements[1], only(isBlue)), 'the second is blue');
});

itInLab('a cut acts on a clip in every frame', async () => {
  const element = await showLoaded({ src: '/net/clip/ball.gsv' });
  assert((await countOf(element, isRed)) > 0, 'red is seen');
  const child = await cut(element, { shape: 'sphere', scale: '100' });
  assertEqual(await countOf(element, isColored), 0, 'the first frame');
  const seeked = nextEvent(element, 'seeked');
  element.currentTime = 0.15;
  await seeked;
  assertEqual(await countOf(element, isColored), 0, 'the second');
  child.remove();
  assert(await comesToShow(element, (screen) => screen.middleOf(isGreen) !== null), 'without it the second is green');
});

it('more cuts than one scene can have are named in a warning', async () => {
  const element = await showLoaded(VIEW);
  for (let i = 0; i < 17; i++) element.append(document.createElement('splat-cut'));
  await claimComing(/at most 16 cuts of one scene/);
});

it('what a shader moves has a pause button, stands still with reduced motion, and axe finds nothing', async () => {
  const code =
    'fn modify(splat: Splat, uniforms: Uniforms) -> Splat { var s = splat; s.position.y += 0.2 * sin(3.0 * uniforms.time); return s; }';
  const buttonOf = (element: GaussianSplatElement): HTMLButtonElement | null =>
    element.shadowRoot!.querySelector('[part~=pause-button]');
  const element = await showLoaded({ ...VIEW, alt: 'A compass' });
  // Autotuning submits work at rest, until its result is stored.
  await until(() => Object.keys(localStorage).some((key) => key.startsWith('gaussian-splat ')), 'a stored choice');
  element.splatShader = { code, animated: true };
  await until(() => buttonOf(element)?.getAttribute('aria-label') === 'Pause', 'a button that pauses');
  assertEqual(await violationsIn(element), [], 'violations');
  const moves = async (): Promise<boolean> => {
    const before = submits;
    await delay(300);
    return submits > before;
  };
  await until(moves, 'it moves');
  buttonOf(element)!.click();
  await until(
    () => buttonOf(element)?.getAttribute('aria-label') === 'Start the motion',
    'the button of what stands still',
  );
  // The frame of better quality at rest comes later on a busy machine; moving elements submit in every interval.
  let isStill = false;
  for (let tries = 0; tries < 20 && !isStill; tries++) isStill = !(await moves());
  assert(isStill, 'it stands still');
  element.remove();
  await emulateMedia({ reducedMotion: 'reduce' });
  try {
    const still = await showLoaded({ ...VIEW, alt: 'A compass', 'reveal-effect': 'grow 60s' });
    await atRest(still);
    const whole = await countOf(still, isColored);
    assert(whole > 0, 'it is visible at once');
    still.splatShader = { code, animated: true };
    await until(() => buttonOf(still)?.getAttribute('aria-label') === 'Start the motion', 'what would move waits');
    await atRest(still);
    assertEqual(await countOf(still, isColored), whole, 'it stands still');
  } finally {
    await emulateMedia({ reducedMotion: 'no-preference' });
  }
});

itInLab('WebGL 2 draws the scene without them, and says so', async () => {
  const element = await showLoaded({ ...VIEW, renderer: 'webgl' });
  const child = document.createElement('splat-cut');
  element.append(child);
  await claimComing(/WebGL 2 draws the scene without <splat-cut>/);
  assert((await countOf(element, isColored)) > 0, 'the scene is there');
});
