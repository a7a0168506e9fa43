/** Several scenes in one element: `<splat-scene>` children, placed, sorted together, each with its own life. */
import '@gaussian-splat/element';
import { GaussianSplatElement } from '@gaussian-splat/element';
import type { SplatSceneElement } from '@gaussian-splat/element/scenes.js';
import { itInLab } from '../../support/extent-in-pages.js';
import { holdings } from './support/ledger.js';
import {
  assert,
  assertEqual,
  COMPASS,
  delay,
  devices,
  FIXTURES,
  frames,
  gated,
  nextEvent,
  printed,
  submits,
  until,
} from './support/harness.js';
import { comesToShow, isBlue, isGreen, isRed, screenOf, type Screen } from './support/screen.js';

const GREEN = `${FIXTURES}green.splat`;
/** From 10 m on the z axis: a meter at the origin is 12.07 pixels. */
const VIEW = 'camera-orbit="0deg 90deg 10m" camera-target="0 0 0" field-of-view="45deg" quality="default"';
const METER = 50 / Math.tan(Math.PI / 8) / 10;

function place(html: string): GaussianSplatElement {
  const page = document.createElement('div');
  page.innerHTML = html;
  document.body.append(page);
  const element = page.querySelector('gaussian-splat')!;
  element.style.cssText = 'display: block; width: 120px; height: 100px';
  return element;
}

async function placeLoaded(html: string): Promise<GaussianSplatElement> {
  const element = place(html);
  await element.ready;
  return element;
}

const childrenOf = (element: Element): SplatSceneElement[] => [
  ...element.querySelectorAll<SplatSceneElement>('splat-scene'),
];

/** Centroid of a color, in meters from the middle of the image. */
async function placeOf(
  element: Element,
  isPicked: Parameters<Awaited<ReturnType<typeof screenOf>>['middleOf']>[0],
): Promise<readonly [number, number] | null> {
  const middle = (await screenOf(element)).middleOf(isPicked);
  return middle && [(middle.x - 60) / METER, (50 - middle.y) / METER];
}

function assertNear(
  actual: readonly number[] | null,
  expected: readonly number[],
  what: string,
  tolerance = 0.15,
): void {
  const isNear = actual?.every((value, k) => Math.abs(value - expected[k]) <= tolerance);
  assert(isNear, `${what}: expected ${expected.join()}, found ${actual?.map((v) => v.toFixed(2)).join() ?? 'nothing'}`);
}

const { releaseDelay } = GaussianSplatElement;
afterEach(() => {
  GaussianSplatElement.releaseDelay = releaseDelay;
});

describe('several scenes in one element', () => {
  it('stand where their attributes say, beside the own scene and without one', async () => {
    const element = await placeLoaded(`<gaussian-splat src="${COMPASS}" ${VIEW}>
      <splat-scene src="${GREEN}" position="2m 100cm 0" scale="0.5"></splat-scene></gaussian-splat>`);
    assertNear(await placeOf(element, isRed), [1, 0], 'the own scene');
    assertEqual(
      childrenOf(element).map(({ loaded, error }) => [loaded, error]),
      [[true, null]],
      'the child',
    );
    const alone = await placeLoaded(`<gaussian-splat ${VIEW}>
      <splat-scene src="${COMPASS}" position="0 1 0" rotation="0 0 90deg" scale="2 2 2"></splat-scene></gaussian-splat>`);
    // Turned counterclockwise, so the right side becomes the top.
    assertNear(await placeOf(alone, isRed), [0, 3], 'red');
    assertNear(await placeOf(alone, isBlue), [0, -1], 'blue');
    assertNear(await placeOf(alone, isGreen), [-2, 1], 'green');
    assert(alone.loaded, 'the element counts as loaded');
    assertEqual(alone.stats?.splats, 6, 'splats');
  });

  it('are upgraded in a shadow tree with a registry of its own', async function () {
    // Some browsers have one registry only.
    let registry;
    try {
      registry = new CustomElementRegistry();
    } catch {
      return this.skip();
    }
    registry.define('gaussian-splat', class extends GaussianSplatElement {});
    const host = document.createElement('div');
    document.body.append(host);
    const options: ShadowRootInit & { customElementRegistry?: unknown } = {
      mode: 'open',
      customElementRegistry: registry,
    };
    const root = host.attachShadow(options);
    root.innerHTML = `<gaussian-splat ${VIEW} loading="eager"><splat-scene src="${COMPASS}"></splat-scene></gaussian-splat>`;
    const element = root.firstElementChild as GaussianSplatElement;
    await element.ready;
    const child = element.firstElementChild as SplatSceneElement;
    assertEqual([element.loaded, child.loaded, child.error], [true, true, null]);
    host.remove();
  });

  itInLab('hide one another, whichever comes first', async () => {
    for (const [first, second] of [
      [`src="${COMPASS}"`, `src="${GREEN}" position="0 0 2m"`],
      [`src="${GREEN}" position="0 0 2m"`, `src="${COMPASS}"`],
    ]) {
      const element = await placeLoaded(
        `<gaussian-splat ${VIEW}><splat-scene ${first}></splat-scene><splat-scene ${second}></splat-scene></gaussian-splat>`,
      );
      const green = (await screenOf(element)).at(60, 50);
      assert(isGreen(green), `the white ball is behind the green one: ${green.join()}`);
      childrenOf(element).find((child) => child.position)!.position = [0, 0, -2];
      await childrenOf(element)[0].updateComplete;
      await frames();
      const white = (await screenOf(element)).at(60, 50);
      assert(
        white.every((channel) => channel > 200),
        `and before it: ${white.join()}`,
      );
      element.remove();
    }
  });

  it('are live: moved, hidden, shown, dimmed, cut, removed and put elsewhere without loading again', async () => {
    const element = await placeLoaded(`<gaussian-splat src="${GREEN}" ${VIEW}>
      <splat-scene src="${COMPASS}" position="3 0 0"></splat-scene></gaussian-splat>`);
    // A busy machine may take longer from one place to the next than a removed scene is kept. Another test waits until it has gone.
    GaussianSplatElement.releaseDelay = 30_000;
    const [child] = childrenOf(element);
    let loads = 0;
    child.addEventListener('loadstart', () => loads++);
    const at = async (x: number, y: number, what: string): Promise<void> =>
      assertNear(await placeOf(element, isRed), [x, y], what);
    await at(4, 0, 'at first');
    child.setAttribute('position', '-3m 1m 0');
    await child.updateComplete;
    await at(-2, 1, 'moved');
    child.matrix = new DOMMatrix().translate(2, -1, 0);
    await child.updateComplete;
    await at(3, -1, 'by a DOMMatrix');
    child.matrix = [1, 0, 0, 3, 0, 1, 0, 2, 0, 0, 1, 0, 0, 0, 0, 1];
    await child.updateComplete;
    await at(4, 2, 'by rows');
    child.matrix = null;
    child.hidden = true;
    await child.updateComplete;
    assert((await placeOf(element, isRed)) === null, 'hidden');
    child.hidden = false;
    child.crop = '-2 -2 -2 0.5 2 2';
    await child.updateComplete;
    assert((await placeOf(element, isRed)) === null && (await placeOf(element, isBlue)), 'cut');
    child.crop = null;
    child.opacity = 0.5;
    await child.updateComplete;
    const [r] = (await screenOf(element)).at(60 + METER * -2, 50 - METER);
    assert(r === 255 && (await placeOf(element, isRed)) === null, 'half of it: pink on the white page');
    child.opacity = null;
    child.scale = 0;
    await child.updateComplete;
    assert((await placeOf(element, isRed)) === null, 'nothing is left with a scale of 0');
    child.scale = null;
    child.remove();
    await frames();
    assert((await placeOf(element, isRed)) === null, 'removed');
    assert(await placeOf(element, isGreen), 'the own scene stays');
    element.prepend(child);
    const isSeen = (screen: Screen): boolean => screen.middleOf(isRed) !== null;
    await comesToShow(element, isSeen);
    await at(-2, 1, 'put back');
    const other = await placeLoaded(`<gaussian-splat src="${GREEN}" ${VIEW}></gaussian-splat>`);
    other.append(child);
    await comesToShow(other, isSeen);
    assertNear(await placeOf(other, isRed), [-2, 1], 'in another element');
    assertEqual(loads, 0, 'further loads');
    child.src = GREEN;
    child.position = '0 3 0';
    await nextEvent(child, 'load');
    const [, y] = (await placeOf(other, isGreen))!;
    assert(y > 1, `another scene in its place: ${y}`);
  });

  it('put into an element that shows nothing yet, is framed there', async () => {
    const child = `<splat-scene src="${COMPASS}" position="20m 0 0"></splat-scene>`;
    const element = await placeLoaded(`<gaussian-splat>${child}</gaussian-splat>`);
    const other = place('<gaussian-splat></gaussian-splat>');
    await other.ready;
    other.append(...childrenOf(element));
    await comesToShow(other, (screen) => screen.middleOf(isRed) !== null);
    assertNear([other.getCameraTarget().x], [20], 'x of the camera target', 1);
  });

  it('24 of them: one missing and one hostile leave 22 visible, with named errors', async () => {
    const children = Array.from({ length: 24 }, (_, i) => {
      const src = i === 5 ? '/net/missing.splat' : i === 11 ? `${FIXTURES}truncated.ply` : GREEN;
      return `<splat-scene src="${src}" scale="0.2" position="${(i % 6) - 2.5} ${Math.floor(i / 6) - 1.5} 0"></splat-scene>`;
    });
    const element = place(`<gaussian-splat ${VIEW}>${children.join('')}</gaussian-splat>`);
    const loads: string[] = [];
    element.addEventListener('load', ({ detail }) => loads.push(detail.url));
    element.addEventListener('error', () => loads.push('error'));
    await element.ready;
    const all = childrenOf(element);
    assertEqual(all.filter(({ loaded }) => loaded).length, 22, 'visible');
    assertEqual([all[5].error?.reason, all[11].error?.code], ['network/status', 'decode'], 'errors');
    const lines = [all[5], all[11]].map(({ error }) => `<splat-scene>: ${error?.message}`);
    assertEqual([...printed].sort(), lines.sort(), 'console');
    assertEqual([element.error, element.loaded, loads.length], [null, true, 1], 'the element');
    assert(element.shadowRoot?.querySelector('[part=error]') === null, 'no message covers them');
    const screen = await screenOf(element);
    for (const [i, { loaded }] of all.entries()) {
      const [x, y] = [60 + METER * ((i % 6) - 2.5), 50 - METER * (Math.floor(i / 6) - 1.5)];
      assertEqual(isGreen(screen.at(x, y)), loaded, `scene ${i}`);
    }
    assertEqual(
      element.stats?.scenes.map(({ state }) => state).filter((state) => state === 'failed').length,
      2,
      'stats',
    );
    assertEqual(element.stats?.total, 22, 'splats of all');
    const before = submits;
    await delay(300);
    assertEqual(submits - before, 0, 'nothing is drawn at rest');
  });

  it('without a source of its own the element is loaded when `load` is fired, not with the first child', async () => {
    const slow = gated('green.splat');
    const element = place(`<gaussian-splat ${VIEW}>
      <splat-scene src="${COMPASS}"></splat-scene><splat-scene src="${slow.src}"></splat-scene></gaussian-splat>`);
    const [first] = childrenOf(element);
    await nextEvent(first, 'load');
    assertEqual([first.loaded, element.loaded, element.progress < 1], [true, false, true], 'after the first child');
    await comesToShow(element, (screen) => screen.middleOf(isRed) !== null);
    const loads: boolean[] = [];
    element.addEventListener('load', () => loads.push(element.loaded));
    await slow.open();
    await element.ready;
    assertEqual([loads.join(), element.loaded, element.progress], ['true', true, 1], 'after both');
    for (const child of childrenOf(element)) child.remove();
    assertEqual(element.loaded, false, 'without children');
  });

  it('frame, pick and save images of the whole', async () => {
    const element = await placeLoaded(`<gaussian-splat src="${GREEN}"></gaussian-splat>`);
    const radius = element.getCameraOrbit().radius;
    const child = document.createElement('splat-scene') as SplatSceneElement;
    child.setAttribute('src', COMPASS);
    child.setAttribute('position', '20m 0 0');
    element.append(child);
    await nextEvent(child, 'load');
    element.jumpCameraToGoal();
    await frames();
    assert(
      element.getCameraOrbit().radius > 2 * radius,
      `the camera goes back: ${element.getCameraOrbit().toString()}`,
    );
    assert(element.getBoundingBox()!.max.x > 20, 'the box has both');
    const red = (await screenOf(element)).middleOf(isRed)!;
    const { left, top } = element.getBoundingClientRect();
    const point = await element.positionFromPoint(left + red.x, top + red.y);
    assert(point && Math.abs(point.x - 21) < 0.5, `picked: ${point?.toString()}`);
    const image = await createImageBitmap(await element.toBlob());
    const context = new OffscreenCanvas(image.width, image.height).getContext('2d')!;
    context.drawImage(image, 0, 0);
    const { data } = context.getImageData(0, 0, image.width, image.height);
    const count = (isPicked: (i: number) => boolean): number =>
      data.filter((_, i) => i % 4 === 0 && isPicked(i)).length;
    assert(count((i) => data[i] > 150 && data[i + 1] < 100 && data[i + 3] > 100) > 0, 'red in the frame');
    assert(count((i) => data[i + 1] > 150 && data[i] < 100 && data[i + 3] > 100) > 0, 'green in the frame');
  });

  itInLab('come back after a lost device, each once, and go without a trace', async () => {
    const before = GaussianSplatElement.releaseDelay;
    GaussianSplatElement.releaseDelay = 0;
    try {
      document.body.replaceChildren();
      await until(() => holdings().objects === 0, 'what others leave to go');
      const element = await placeLoaded(`<gaussian-splat src="${COMPASS}" ${VIEW}>
        ${[0, 1, 2].map((i) => `<splat-scene src="${GREEN}" scale="0.3" position="${2 * i - 2} 2 0"></splat-scene>`).join('')}
        </gaussian-splat>`);
      const events: string[] = [];
      for (const type of ['contextlost', 'contextrestored', 'load', 'error'] as const)
        element.addEventListener(type, () => events.push(type));
      const image = await screenOf(element);
      const restored = nextEvent(element, 'contextrestored');
      devices.at(-1)!.destroy();
      await restored;
      await frames();
      assertEqual((await screenOf(element)).differences(image, 2), 0, 'the frame is back');
      assertEqual(events, ['contextlost', 'contextrestored'], 'events');
      childrenOf(element)[1].remove();
      await frames();
      document.body.replaceChildren();
      await delay(200);
      assertEqual(holdings(), { objects: 0, bytes: 0 }, 'what lives on the GPU');
    } finally {
      GaussianSplatElement.releaseDelay = before;
    }
  });

  itInLab('have their own clocks, or follow that of the element', async () => {
    const movie = '/net/sequence/movie.json';
    const element = await placeLoaded(`<gaussian-splat ${VIEW}>
      <splat-scene src="${movie}" position="-2 0 0"></splat-scene>
      <splat-scene src="${movie}" position="2 0 0" autoplay loop></splat-scene></gaussian-splat>`);
    const [follower, own] = childrenOf(element);
    assertEqual([element.duration, follower.duration, own.duration], [1.2, 1.2, 1.2], 'durations');
    assertEqual([element.paused, own.paused], [true, false], 'who plays');
    await until(() => own.currentTime > 0.3, 'its time to continue');
    assertEqual(element.currentTime, 0, 'the time of the element');
    own.pause();
    // The second frame is green, the fourth red.
    own.currentTime = 0.35;
    const seeked = nextEvent(element, 'seeked');
    element.currentTime = 0.15;
    await seeked;
    const isLeft = async (): Promise<boolean> => ((await placeOf(element, isGreen))?.[0] ?? 0) < -1.4;
    await until(isLeft, 'the frame of that time');
    assertNear(await placeOf(element, isGreen), [-2, 0], 'the frame of that time', 0.6);
    const third = await placeLoaded(`<gaussian-splat autoplay loop ${VIEW}><splat-scene src="${GREEN}"></splat-scene>
      <splat-scene src="${movie}"></splat-scene></gaussian-splat>`);
    await until(() => !third.paused && third.currentTime > 0.1, 'the clock of an element that plays automatically');
    third.remove();
    const button = element.shadowRoot?.querySelector<HTMLButtonElement>('[part=pause-button]');
    assert(button, 'visitors can start and stop automatic motion');
    button.click();
    assert(!own.paused && element.paused, 'it plays again');
    button.click();
    assert(own.paused, 'it stops');
  });
});
