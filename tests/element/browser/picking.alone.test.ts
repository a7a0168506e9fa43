/** Points of the scene: under a pointer, under a label, and the image of all of them. */
import { insideOf } from './support/inside.js';
import '@gaussian-splat/element';
import type { GaussianSplatElement } from '@gaussian-splat/element';
import { GaussianSplatElement as ElementClass } from '@gaussian-splat/element';
import { sendKeys, sendMouse } from '@web/test-runner-commands';
import {
  assert,
  assertEqual,
  atRest,
  COMPASS,
  delay,
  frames,
  nextEvent,
  show,
  showLoaded,
  submits,
  until,
} from './support/harness.js';
import { someOf } from '../../support/extent-in-pages.js';
import { isGreen, isRed, screenOf, Taps } from './support/screen.js';
import { roughPlane } from '../../support/rough-plane.js';

const STILL = { 'interpolation-decay': '0', 'interaction-prompt': 'none' };

async function compass(attributes: Readonly<Record<string, string>> = {}): Promise<GaussianSplatElement> {
  document.body.style.margin = '0';
  return showLoaded({ 'camera-orbit': '0deg 90deg 8m', ...STILL, ...attributes }, 'width: 200px; height: 160px');
}

const near = (actual: number, expected: number, tolerance: number, what: string): void =>
  assert(Math.abs(actual - expected) <= tolerance, `${what}: expected ${expected}, found ${actual}`);

/** CSS pixels of a point in viewer space, by the documented pinhole geometry for theta 0, phi 90 degrees. */
function pageOf(element: GaussianSplatElement, [x, y, z]: readonly number[]): [number, number] {
  const { radius } = element.getCameraOrbit();
  const focal = 160 / 2 / Math.tan(element.getFieldOfView().radians / 2);
  return [100 + (focal * x) / (radius - z), 80 - (focal * y) / (radius - z)];
}

function label(element: GaussianSplatElement, name: string, position: string, more: object = {}): HTMLElement {
  const button = document.createElement('button');
  button.slot = `hotspot-${name}`;
  button.textContent = name;
  Object.assign(button.dataset, { position, ...more });
  element.append(button);
  return button;
}

describe('positionFromPoint', () => {
  it('finds the ball under the pointer, and nothing beside it', async () => {
    const element = await compass();
    const balls = [
      [0, 0, 1],
      [1, 0, 0],
      [-1, 0, 0],
      [0, 1, 0],
    ];
    for (const ball of balls) {
      const point = await element.positionFromPoint(...pageOf(element, ball));
      assert(point, `nothing at ${ball.join()}`);
      [point.x, point.y, point.z].forEach((value, axis) =>
        near(value, ball[axis], 0.02, `${ball.join()} axis ${axis}`),
      );
    }
    assertEqual(await element.positionFromPoint(3, 3), null, 'beside the scene');
    assertEqual(await element.positionFromPoint(-50, 900), null, 'beside the element');
  });

  for (const renderer of someOf(['webgpu', 'webgl'], 1))
    it(`${renderer}: picks on a floor of wide splats are on the floor, with their uncertainty`, async () => {
      document.body.style.margin = '0';
      const splats = Array.from({ length: 100 * 100 }, (_, i) => [
        (i % 100) / 12.5 - 4,
        Math.floor(i / 100) / 12.5 - 4,
      ]);
      const bytes = new DataView(new ArrayBuffer(32 * splats.length));
      splats.forEach(([x, z], i) => {
        [x, 0, z, 0.1, 0.002, 0.1].forEach((value, k) => bytes.setFloat32(32 * i + 4 * k, value, true));
        [200, 120, 40, 230, 255, 128, 128, 128].forEach((value, k) => bytes.setUint8(32 * i + 24 + k, value));
      });
      const src = `${URL.createObjectURL(new Blob([bytes.buffer]))}#floor.splat`;
      // Eyes 1.6 m above the floor, which they look at 4 m ahead.
      const camera = { 'camera-orbit': '0deg 68.2deg 4.308m', 'camera-target': '0m 0m 0m', 'field-of-view': '45deg' };
      const element = await showLoaded({ src, renderer, ...camera, ...STILL }, 'width: 240px; height: 180px');
      await atRest(element);
      const errors: number[] = [];
      for (let i = 0; i < 30; i++) {
        const point = await element.positionFromPoint(20 + 40 * (i % 6), 80 + 18 * Math.floor(i / 6));
        assert(point, `nothing at point ${i}`);
        assert(point.uncertainty < 0.5, `uncertainty ${point.uncertainty} of point ${i}`);
        // On the ray the error is larger than in height.
        errors.push(Math.abs(point.y) * (Math.hypot(point.x, point.z - 4, 1.6) / 1.6));
      }
      errors.sort((a, b) => a - b);
      assert(errors[15] < 0.01 && errors[28] < 0.02, `median ${errors[15]} m, 95 % ${errors[28]} m`);
    });

  for (const renderer of someOf(['webgl', 'webgpu'], 1))
    it(`${renderer}: a pick on a rough plane is on the plane of its splats, within the stated interval`, async () => {
      document.body.style.margin = '0';
      const plane = roughPlane({ noise: 0.02, shape: 'flat', lean: 0, distance: 0 });
      const bytes = new DataView(new ArrayBuffer(32 * plane.count));
      for (let i = 0; i < plane.count; i++) {
        const numbers = [...plane.positions.subarray(3 * i, 3 * i + 3), ...plane.scales.subarray(3 * i, 3 * i + 3)];
        numbers.forEach((value, k) => bytes.setFloat32(32 * i + 4 * k, value, true));
        const turn = [...plane.rotations.subarray(4 * i, 4 * i + 4)].map((v) => Math.round(128 + 127 * v));
        [150, 150, 150, 255 * plane.opacities[i], ...turn].forEach((v, k) => bytes.setUint8(32 * i + 24 + k, v));
      }
      const src = `${URL.createObjectURL(new Blob([bytes.buffer]))}#plane.splat`;
      const camera = { 'camera-orbit': '0deg 90deg 3m', 'camera-target': '0m 0m 0m', 'field-of-view': '45deg' };
      const element = await showLoaded({ src, renderer, ...camera, ...STILL }, 'width: 240px; height: 180px');
      await atRest(element);
      const points = [];
      for (let i = 0; i < 25; i++) {
        const point = await element.positionFromPoint(80 + 20 * (i % 5), 50 + 20 * Math.floor(i / 5));
        assert(point, `nothing at point ${i}`);
        points.push(point);
      }
      // The line of sight is nearly the z axis. Files of this type have y down, so z is turned, too.
      const errors = points.map(({ z }) => Math.abs(z)).sort((a, b) => a - b);
      const held = points.filter(({ z, uncertainty }) => Math.abs(z) <= uncertainty).length;
      const [half, interval] = [errors[12], points.map((p) => p.uncertainty).sort((a, b) => a - b)[12]];
      assert(half < 0.015, `median error ${half} m`);
      assert(held >= 17 && interval < 0.08, `${held} of 25 within ± ${interval} m`);
      assert(
        points.every(({ normal }) => normal.z > 0.7),
        points.map(({ normal }) => normal.z.toFixed(2)).join(),
      );
    });

  it('finds it as well in an element with a border that transforms have scaled', async () => {
    const element = await compass();
    const [x, y] = pageOf(element, [1, 0, 0]);
    element.style.cssText +=
      'border: 10px solid; box-sizing: content-box; transform: scale(2, 1.5); transform-origin: 0 0';
    await frames(3);
    const point = await element.positionFromPoint(2 * (x + 10), 1.5 * (y + 10));
    near(point?.x ?? NaN, 1, 0.05, 'the red ball');
  });

  it('reads from the GPU only when asked, and knows the frame that is on the screen', async () => {
    const element = await compass();
    await frames(3);
    const before = submits;
    element.cameraOrbit = '90deg 90deg 8m';
    await nextEvent(element, 'camera-change');
    assertEqual(submits - before, 1, 'submits for the frame');
    const point = await element.positionFromPoint(100, 80);
    near(point?.x ?? NaN, 1, 0.02, 'from the right, the red ball is in the middle');
    assertEqual(submits - before, 2, 'submits with the question');
  });

  it('has no answer without a scene, and none after the device is gone', async () => {
    const empty = show({}, 'width: 200px; height: 160px');
    assertEqual(await empty.positionFromPoint(100, 80), null);
    empty.remove();
    const element = await compass();
    const asked = element.positionFromPoint(100, 80);
    element.src = null;
    await asked;
    await element.updateComplete;
    assertEqual(await element.positionFromPoint(100, 80), null, 'of a scene that was taken away');
  });

  it('a double click picks the point to turn around, disable-tap keeps it', async () => {
    const element = await compass({ 'camera-controls': '' });
    const doubleClick = async (): Promise<void> => {
      const [x, y] = pageOf(element, [1, 0, 0]);
      const position: [number, number] = [Math.round(x), Math.round(y)];
      const options = { bubbles: true, clientX: position[0], clientY: position[1] };
      element.shadowRoot?.querySelector('#view')?.dispatchEvent(new MouseEvent('dblclick', options));
      await sendMouse({ type: 'move', position });
      await delay(300);
    };
    element.disableTap = true;
    await element.updateComplete;
    await doubleClick();
    near(element.getCameraTarget().x, 0, 1e-9, 'with disable-tap');
    element.disableTap = false;
    await element.updateComplete;
    await doubleClick();
    near(element.getCameraTarget().x, 1, 0.03, 'without');
  });

  it('a double tap picks it as well, once, and taps that are none do not', async () => {
    const element = await compass({ 'camera-controls': '', 'disable-tap': '' });
    const [x, y] = pageOf(element, [1, 0, 0]);
    const taps = new Taps();
    let picks = 0;
    const core = insideOf(element);
    const ask = core.positionFromPoint.bind(core);
    core.positionFromPoint = (...place) => (picks++, ask(...place));
    await taps.tap(x, y);
    await taps.tap(x, y);
    await delay(400);
    near(element.getCameraTarget().x, 0, 1e-9, 'with disable-tap');
    element.disableTap = false;
    await element.updateComplete;
    for (const [pause, dx] of [
      [500, 0],
      [80, 60],
    ]) {
      picks = 0;
      await taps.tap(x, y, 500);
      await taps.tap(x + dx, y, pause);
      await delay(500);
      assertEqual(picks, 0, `picks of taps ${pause} ms and ${dx} px apart`);
    }
    await taps.tap(x, y, 500);
    await taps.tap(x, y);
    await until(() => picks > 0, 'a pick');
    await delay(500);
    assertEqual(picks, 1, 'picks');
    near(element.getCameraTarget().x, 1, 0.03, 'where it was tapped');
  });
});

describe('hotspots', () => {
  it('stand at their points and move with the camera', async () => {
    const element = await compass();
    const button = label(element, 'red', '1m 0 0');
    const middleOf = (): [number, number] => {
      const { left, top, width, height } = button.getBoundingClientRect();
      return [left + width / 2, top + height / 2];
    };
    const [x, y] = pageOf(element, [1, 0, 0]);
    await until(() => Math.abs(middleOf()[0] - x) < 0.6, 'the label to be placed');
    near(middleOf()[1], y, 0.6, 'y');
    element.cameraOrbit = '90deg 90deg 8m';
    await nextEvent(element, 'camera-change');
    await frames();
    near(middleOf()[0], 100, 0.6, 'x from the right');
    button.dataset.position = '0m 1m 0m';
    await until(() => middleOf()[1] < 70, 'the label to go to the top');
    const place = element.queryHotspot('hotspot-red');
    assertEqual([place?.position.y, place?.normal, element.queryHotspot('hotspot-none')], [1, null, null]);
  });

  it('fade where scenery hides them, and come back', async () => {
    const element = await compass();
    const [front, back] = [
      label(element, 'front', '0m 0m 1m'),
      label(element, 'back', '0m 0m -1m', { visibilityAttribute: 'visible' }),
    ];
    const opacity = (button: HTMLElement): number =>
      Number(getComputedStyle(button.assignedSlot?.parentElement ?? button).opacity);
    const seen: boolean[] = [];
    back.addEventListener('hotspot-visibility', (event) => seen.push((event as CustomEvent).detail.visible));
    await until(() => opacity(back) < 0.3 && opacity(front) > 0.95, 'the label behind the white ball to fade');
    assert(!back.hasAttribute('data-visible') && front.matches(':not([data-visible])'), 'attributes');
    element.cameraOrbit = '180deg 90deg 8m';
    await until(() => opacity(back) > 0.95 && opacity(front) < 0.3, 'both to change places');
    assert(back.hasAttribute('data-visible'), 'the attribute');
    assertEqual(seen.at(-1), true, 'events');
    element.style.setProperty('--min-hotspot-opacity', '0.6');
    await until(() => Math.abs(opacity(front) - 0.6) < 0.01, 'the custom property');
  });

  it('that are used lie over their neighbors', async () => {
    // The label under the mouse would be in use, too.
    await sendMouse({ type: 'move', position: [400, 400] });
    const element = await compass();
    const first = label(element, 'first', '0m 0m 1m');
    const second = label(element, 'second', '0m 0.02m 1m');
    for (const { style } of [first, second]) style.cssText = 'width: 60px; height: 30px';
    await until(() => second.getBoundingClientRect().width > 0 && hit() === second, 'the second over the first');
    function hit(): Element | null {
      const { left, top, width, height } = first.getBoundingClientRect();
      return document.elementFromPoint(left + width / 2, top + height / 2);
    }
    first.focus();
    await until(() => hit() === first, 'the label with the focus over the other');
    first.blur();
    await until(() => hit() === second, 'the order of before');
  });

  it('read WebGL frames without a wait for the GPU', async () => {
    const { readPixels } = WebGL2RenderingContext.prototype;
    const reads = { later: 0, waiting: 0 };
    WebGL2RenderingContext.prototype.readPixels = function (this: WebGL2RenderingContext, ...args: unknown[]) {
      // An offset into a buffer of pixels is a number; memory of the page makes the thread wait.
      reads[typeof args[6] === 'number' ? 'later' : 'waiting']++;
      Reflect.apply(readPixels, this, args);
    };
    try {
      const element = await compass({ renderer: 'webgl' });
      label(element, 'front', '0m 0m 1m');
      label(element, 'back', '0m 0m -1m');
      const sees = (name: string): boolean | undefined => element.queryHotspot(`hotspot-${name}`)?.visible;
      await until(
        () => sees('front') === true && sees('back') === false,
        'the label behind the white ball to be hidden',
      );
      element.cameraOrbit = '180deg 90deg 8m';
      await until(() => sees('front') === false && sees('back') === true, 'both to change places');
      const point = await element.positionFromPoint(100, 80);
      near(point?.z ?? NaN, -1, 0.3, 'the ball that is near');
      await element.updateStats();
      assert(reads.later > 2, `reads of the labels and the pick: ${reads.later}`);
      assertEqual(reads.waiting, 0, 'reads that wait');
    } finally {
      WebGL2RenderingContext.prototype.readPixels = readPixels;
    }
  });

  it('that are added, or move, while nothing else moves are checked, too', async () => {
    const element = await compass();
    const sees = (name: string, expected: boolean, what: string): Promise<void> =>
      until(() => element.queryHotspot(`hotspot-${name}`)?.visible === expected, what, 3_000);
    await delay(800);
    const moved = label(element, 'moved', '0m 0m -1m');
    await sees('moved', false, 'a label that came behind the white ball to be hidden');
    moved.dataset.position = '0m 0m 1m';
    await sees('moved', true, 'the label before it to be seen');
    moved.dataset.position = '0m 0m -1m';
    await sees('moved', false, 'the label behind it again to be hidden');
  });

  it('with a normal that points away count as hidden, and those behind the camera are gone', async () => {
    const element = await compass();
    label(element, 'away', '0m 0m 1m', { normal: '0m 0m -1m' });
    label(element, 'towards', '0m 0m 1m', { normal: '0m 0m 1m' });
    const behind = label(element, 'behind', '0m 0m 20m');
    await frames(4);
    assertEqual(element.queryHotspot('hotspot-away')?.facingCamera, false);
    assertEqual(element.queryHotspot('hotspot-towards')?.facingCamera, true);
    assertEqual(element.queryHotspot('hotspot-behind')?.canvasPosition, null);
    assertEqual(getComputedStyle(behind).visibility, 'hidden', 'behind the camera');
    behind.focus();
    assert(document.activeElement !== behind, 'what cannot be seen takes no focus');
  });

  it('are neither seen nor reached without a frame, without a position, and under a poster', async () => {
    const isGone = async (element: GaussianSplatElement, button: HTMLElement): Promise<boolean> => {
      await element.updateComplete;
      await frames();
      (document.activeElement as HTMLElement | null)?.blur();
      await sendKeys({ press: 'Tab' });
      return getComputedStyle(button).visibility === 'hidden' && document.activeElement !== button;
    };
    const slow = show({ src: '/net/slow/compass.ply?ms=800' });
    const early = label(slow, 'early', '0m 0m 1m');
    assert(await isGone(slow, early), 'while the scene loads');
    await slow.ready;
    await frames();
    assertEqual(await isGone(slow, early), false, 'gone once the scene is there');
    slow.remove();

    const missing = show({ src: '/net/status/404' });
    const lost = label(missing, 'lost', '0m 0m 1m');
    await missing.ready;
    assert(await isGone(missing, lost), 'after an error');
    missing.remove();

    const element = await compass();
    const [placed, nowhere] = [label(element, 'placed', '0m 0m 1m'), label(element, 'nowhere', '')];
    delete nowhere.dataset.position;
    await frames(3);
    assertEqual([await isGone(element, placed), await isGone(element, nowhere)], [false, true], 'without a position');
    element.showPoster();
    assert(await isGone(element, placed), 'under the poster');
    element.dismissPoster();
    assertEqual(await isGone(element, placed), false, 'gone after the poster');
    element.src = null;
    assert(await isGone(element, placed), 'over an empty canvas');
    assertEqual(element.queryHotspot('hotspot-placed')?.canvasPosition, null, 'where it is');
  });

  it('that replace one another are notified of their visibility', async () => {
    const element = await compass();
    const first = label(element, 'same', '0m 0m 1m', { visibilityAttribute: 'seen' });
    await until(() => first.hasAttribute('data-seen'), 'the first label to be seen');
    first.remove();
    const second = label(element, 'same', '0m 0m 1m', { visibilityAttribute: 'seen' });
    await until(() => second.hasAttribute('data-seen'), 'the second one to be notified as well', 3_000);
  });

  it('cost nothing while nothing moves, and can be clicked', async () => {
    const element = await compass({ 'camera-controls': '' });
    const button = label(element, 'front', '0m 0m 1m');
    let clicks = 0;
    button.addEventListener('click', () => clicks++);
    await atRest(element, 600);
    const before = submits;
    await delay(600);
    assertEqual(submits - before, 0, 'submits');
    const { left, top, width, height } = button.getBoundingClientRect();
    await sendMouse({ type: 'click', position: [Math.round(left + width / 2), Math.round(top + height / 2)] });
    assertEqual(clicks, 1, 'clicks');
    button.remove();
    await frames();
    assertEqual(element.shadowRoot?.querySelectorAll('.hotspot').length, 0, 'boxes');
  });
});

describe('pictures', () => {
  it('toBlob() and toDataURL() hold what is on the screen', async () => {
    const element = await compass({ 'camera-orbit': '30deg 70deg 8m' });
    element.style.background = 'black';
    const screen = await screenOf(element);
    const sources = [URL.createObjectURL(await element.toBlob()), element.toDataURL()];
    for (const source of sources) {
      const image = new Image();
      image.src = source;
      image.style.cssText = 'display: block; width: 200px; height: 160px; background: black';
      await image.decode();
      assertEqual([image.naturalWidth, image.naturalHeight], [200, 160], 'size');
      document.body.prepend(image);
      const differing = (await screenOf(image)).differences(screen, 2);
      image.remove();
      assertEqual(differing, 0, 'differing color values');
    }
    assert((await element.toBlob({ mimeType: 'image/webp', qualityArgument: 0.5 })).type === 'image/webp', 'webp');
    assertEqual((await screenOf(element)).differences(screen), 0, 'the page afterwards');
  });

  it('have the size and the background that are asked for, and the page shows what it showed', async () => {
    const element = await compass({ 'camera-orbit': '30deg 70deg 8m' });
    const before = await screenOf(element);
    const pixelsOf = async (blob: Blob): Promise<ImageData> => {
      const image = await createImageBitmap(blob);
      const context = new OffscreenCanvas(image.width, image.height).getContext('2d')!;
      context.drawImage(image, 0, 0);
      return context.getImageData(0, 0, image.width, image.height);
    };
    const large = await pixelsOf(await element.toBlob({ width: 600, background: 'rgb(0 128 255)' }));
    assertEqual([large.width, large.height], [600, 480], 'size');
    assertEqual([...large.data.subarray(0, 4)], [0, 128, 255, 255], 'the corner');
    assertEqual((await screenOf(element)).differences(before), 0, 'the page afterwards');
    const wide = await pixelsOf(await element.toBlob({ width: 300, height: 100 }));
    assertEqual([wide.width, wide.height, wide.data[3]], [300, 100, 0], 'transparent');
    const refused = (options: object): Promise<string> => element.toBlob(options).then(() => 'none', ({ name }: Error) => name); // prettier-ignore
    assertEqual(await refused({ width: 1e6 }), 'RangeError');
    assertEqual(await refused({ background: 'no color' }), 'TypeError');
    element.style.filter = 'brightness(0)';
    const dark = await pixelsOf(await element.toBlob());
    const max = dark.data.reduce((found, value, i) => (i % 4 === 3 ? found : Math.max(found, value)), 0);
    assertEqual(max, 0, 'the filter of the element');
  });

  it('count attributes that were set just before', async () => {
    const element = await compass();
    element.maxPixelRatio = 0.5;
    const image = new Image();
    image.src = element.toDataURL();
    await image.decode();
    assertEqual([image.naturalWidth, image.naturalHeight], [100, 80], 'size');
  });

  it('are refused where there is no scene', async () => {
    const element = show({});
    const refusal = await element.toBlob().then(
      () => 'none',
      (error: Error) => error.name,
    );
    assertEqual(refusal, 'InvalidStateError');
  });
});

describe('the scene as a whole', () => {
  it('has a box in viewer space', async () => {
    const element = await compass();
    const box = element.getBoundingBox();
    assert(box, 'a box');
    for (const axis of ['x', 'y', 'z'] as const) {
      assert(box.min[axis] <= -0.9 && box.min[axis] > -1.8, `min ${axis} ${box.min[axis]}`);
      assert(box.max[axis] >= 0.9 && box.max[axis] < 1.8, `max ${axis} ${box.max[axis]}`);
    }
    assertEqual(show({}).getBoundingBox(), null, 'without a scene');
  });

  it('updateFraming() frames it again', async () => {
    const element = await compass({ 'camera-orbit': 'auto' });
    const framed = String(element.getCameraOrbit());
    element.cameraOrbit = '10deg 20deg 3m';
    element.jumpCameraToGoal();
    element.cameraOrbit = 'auto';
    await element.updateFraming();
    assertEqual(String(element.getCameraOrbit()), framed);
  });

  it('moveBefore() keeps the frame and the scene', async () => {
    const element = await compass();
    const parent = document.createElement('section');
    document.body.append(parent);
    const move = (parent as unknown as { moveBefore?: (node: Node, child: Node | null) => void }).moveBefore;
    assert(move, 'this browser has moveBefore');
    let events = 0;
    for (const type of ['loadstart', 'load', 'emptied', 'contextlost']) element.addEventListener(type, () => events++);
    move.call(parent, element, null);
    await frames(3);
    assertEqual([element.loaded, events], [true, 0]);
    element.cameraOrbit = '90deg 90deg 8m';
    await nextEvent(element, 'camera-change');
    assert((await screenOf(element)).middleOf(isRed), 'it still draws');
  });

  it('urlModifier rewrites its address', async () => {
    ElementClass.urlModifier = (url) => url.replace('compass', 'green');
    try {
      const element = await showLoaded({ src: COMPASS });
      assert((await screenOf(element)).middleOf(isGreen), 'the other scene');
    } finally {
      ElementClass.urlModifier = null;
    }
  });
});
