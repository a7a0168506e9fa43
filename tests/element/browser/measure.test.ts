/** The ruler: by mouse and by keyboard alone, its length, its texts, and the announcements of a screen reader. */
import '@gaussian-splat/element';
import type { GaussianSplatElement } from '@gaussian-splat/element';
import { insideOf } from './support/inside.js';
import { toScene } from '../../support/element/camera.js';
import { edges } from '../../support/element/parts.js';
import { sendKeys } from '@web/test-runner-commands';
import { assert, assertEqual, atRest, delay, nextEvent, showLoaded, until } from './support/harness.js';

const STILL = { 'interpolation-decay': '0', 'interaction-prompt': 'none', 'camera-controls': '' };

/** A floor of flat splats at y = 0, 0.1 units apart, 8 x 8 units, as a `.splat`: y down. */
function floor(): string {
  const side = 81;
  const rows = new Float32Array(8 * side * side);
  const bytes = new Uint8Array(rows.buffer);
  for (let i = 0; i < side * side; i++) {
    const [x, z] = [(i % side) / 10 - 4, Math.floor(i / side) / 10 - 4];
    rows.set([x, 0, z, 0.08, 0.005, 0.08], 8 * i);
    bytes.set([150, 140, 120, 255, 255, 128, 128, 128], 32 * i + 24);
  }
  return `${URL.createObjectURL(new Blob([rows]))}#floor.splat`;
}

/** The inside of a cube from -2 to 2, of flat splats, as a `.splat`. */
function room(): string {
  const side = 41;
  const count = 6 * side * side;
  const rows = new Float32Array(8 * count);
  const bytes = new Uint8Array(rows.buffer);
  for (let i = 0; i < count; i++) {
    const face = Math.floor(i / side ** 2);
    const [u, v] = [(i % side) / 10 - 2, (Math.floor(i / side) % side) / 10 - 2];
    const axis = face % 3;
    const across = [(axis + 1) % 3, (axis + 2) % 3];
    const place = [0, 0, 0];
    [place[axis], place[across[0]], place[across[1]]] = [face < 3 ? -2 : 2, u, v];
    const size = [0.07, 0.07, 0.07];
    size[axis] = 0.003;
    rows.set([...place, ...size], 8 * i);
    bytes.set([90 + 20 * face, 140, 120, 255, 255, 128, 128, 128], 32 * i + 24);
  }
  return `${URL.createObjectURL(new Blob([rows]))}#room.splat`;
}

const button = (element: GaussianSplatElement): HTMLButtonElement | null =>
  element.shadowRoot!.querySelector('[part=measure-button]');
const label = (element: GaussianSplatElement): string =>
  element.shadowRoot!.querySelector('[part=measure-label]')?.textContent ?? '';
const spoken = (element: GaussianSplatElement): string =>
  element.shadowRoot!.querySelector('[aria-live], [role=status]')?.textContent?.trim() ?? '';

interface Measured {
  readonly length: number;
  readonly meters: number | null;
  readonly uncertainty: number;
  readonly perpendicular: number | null;
}

const FROM_ABOVE = {
  'camera-orbit': '0deg 25deg 7m',
  'camera-target': '0m 0m 0m',
  'min-camera-orbit': 'auto 0deg auto',
};

async function ruler(attributes: Readonly<Record<string, string>>): Promise<GaussianSplatElement> {
  const all = { src: floor(), measure: '', ...STILL, ...FROM_ABOVE, ...attributes };
  const element = await showLoaded(all, 'width: 240px; height: 200px');
  await until(() => button(element) !== null, 'the button');
  await atRest(element);
  return element;
}

describe('measure', () => {
  it('measures between two clicks, in meters where a unit is given', async () => {
    const element = await ruler({ unit: '50cm' });
    button(element)!.click();
    await element.updateComplete;
    assertEqual(button(element)!.getAttribute('aria-pressed'), 'true', 'pressed');
    const view = element.shadowRoot!.querySelector<HTMLElement>('#view')!;
    const { left, top } = view.getBoundingClientRect();
    const points = [
      [40, 100],
      [200, 100],
    ].map(([x, y]) => ({ clientX: left + x, clientY: top + y }));
    const expected = await Promise.all(
      points.map(({ clientX, clientY }) => element.positionFromPoint(clientX, clientY)),
    );
    const measured = nextEvent<CustomEvent<Measured>>(element, 'measure');
    for (const place of points) {
      view.dispatchEvent(new PointerEvent('pointerdown', { ...place, bubbles: true }));
      view.dispatchEvent(new MouseEvent('click', { ...place, bubbles: true }));
      await until(() => element.shadowRoot!.querySelector('.ruler circle') !== null, 'an end');
    }
    const { detail } = await measured;
    // The points lie side by side on the floor, at the distance of its middle: that is known without the pick.
    const truth = (160 / 200) * 7 * 2 * Math.tan(Math.PI / 8);
    assert(Math.abs(detail.length / truth - 1) < 0.005, `${detail.length} in place of ${truth}`);
    assert(Math.abs(detail.meters! - detail.length / 2) < 1e-9, `${detail.meters} m`);
    assert(detail.uncertainty < 0.2 && expected.every(Boolean), `± ${detail.uncertainty}`);
    assert(/^2\.\d\d m ± 0\.\d\d m$/.test(label(element)), label(element));
    await until(() => spoken(element) === label(element), `its words, not ${spoken(element)}`);
    const before = element.shadowRoot!.querySelector('.ruler line')!.getAttribute('x1');
    element.setAttribute('camera-orbit', '40deg 25deg 7m');
    await until(
      () => element.shadowRoot!.querySelector('.ruler line')?.getAttribute('x1') !== before,
      'a line that moves with the view',
    );
  });

  it('measures by keyboard alone, and without a unit speaks of no meters', async () => {
    const element = await ruler({});
    const view = element.shadowRoot!.querySelector<HTMLElement>('#view')!;
    button(element)!.focus();
    button(element)!.click();
    view.focus();
    const press = (key: string): boolean =>
      view.dispatchEvent(new KeyboardEvent('keydown', { key, code: key, bubbles: true }));
    press('Enter');
    await until(() => element.shadowRoot!.querySelectorAll('.ruler circle').length === 2, 'the first end and the mark');
    await until(() => spoken(element) === 'First end set', `the announcement, not ${spoken(element)}`);
    for (let i = 0; i < 3; i++) press('ArrowRight');
    element.setAttribute('camera-target', '1m 0m 0m');
    await atRest(element);
    const measured = nextEvent<CustomEvent<Measured>>(element, 'measure');
    press('Enter');
    const { detail } = await measured;
    assertEqual(detail.meters, null, 'meters');
    assert(detail.length > 0.5 && detail.length < 1.5, `${detail.length}`);
    assert(!/m/.test(label(element)) && label(element).includes('±'), label(element));
    // Another unit counts at once, and a key that is held down is one key press.
    element.setAttribute('unit', '2m');
    await until(() => / m ± .* m$/.test(label(element)), 'a length in meters');
    const hasLine = (): boolean => element.shadowRoot!.querySelector('.ruler line') !== null;
    view.dispatchEvent(new KeyboardEvent('keydown', { key: 'Enter', code: 'Enter', bubbles: true, repeat: true }));
    await delay(200);
    assert(hasLine(), 'a repeated key sets another end');
    element.src = floor();
    await element.ready;
    await until(() => !hasLine(), 'an end of the ruler of another scene');
    press('Escape');
    await element.updateComplete;
    assertEqual(element.shadowRoot!.querySelector('.ruler'), null, 'the ruler');
    assertEqual(element.shadowRoot!.activeElement, button(element), 'focus');
  });

  it('keeps the length when an end is behind the camera, and says how far parallel walls are apart', async () => {
    const element = await ruler({
      src: room(),
      'camera-orbit': '0deg 90deg 1m',
      'max-camera-orbit': 'auto auto 2m',
      unit: '1m',
    });
    button(element)!.click();
    const view = element.shadowRoot!.querySelector<HTMLElement>('#view')!;
    const click = (x: number, y: number): void => {
      const { left, top } = view.getBoundingClientRect();
      const place = { clientX: left + x, clientY: top + y, bubbles: true };
      view.dispatchEvent(new PointerEvent('pointerdown', place));
      view.dispatchEvent(new MouseEvent('click', place));
    };
    click(120, 100);
    await until(() => element.shadowRoot!.querySelector('.ruler circle') !== null, 'the first end');
    element.setAttribute('camera-orbit', '180deg 90deg 1m');
    await atRest(element);
    const measured = nextEvent<CustomEvent<Measured>>(element, 'measure');
    click(200, 100);
    const { detail } = await measured;
    assert(Math.abs(detail.perpendicular! - 4) < 0.05, `${detail.perpendicular} m between walls of 4 m`);
    assert(detail.length > 4.02 && detail.length < 5, `${detail.length}`);
    assert(/ · ⊥ 4\.0\d m$/.test(label(element)), label(element));
    assert(element.shadowRoot!.querySelectorAll('.ruler circle').length === 1, 'one end is behind the camera');
    assert(element.shadowRoot!.querySelector('.ruler line'), 'no line');
    const [box, around] = ['[part=measure-label]', '#view'].map((each) =>
      element.shadowRoot!.querySelector(each)!.getBoundingClientRect(),
    );
    assert(
      box.width > 0 && box.left >= around.left - 1 && box.right <= around.right + 1,
      `${box.left} to ${box.right}`,
    );
    assert(box.top >= around.top && box.bottom <= around.bottom, `${box.top} to ${box.bottom}`);
  });

  it('sets an end on the edge of two walls, and in the corner of three', async () => {
    const element = await ruler({ src: room(), 'camera-orbit': '45deg 55deg 2m', 'max-camera-orbit': 'auto auto 2m' });
    button(element)!.click();
    const view = element.shadowRoot!.querySelector<HTMLElement>('#view')!;
    const { left, top } = view.getBoundingClientRect();
    const core = insideOf(element);
    // The view looks down into the corner at (-2, -2, -2) of viewer space.
    const at = (p: readonly [number, number, number]): { x: number; y: number } => {
      const camera = core.drawnFrom!;
      const [x, y, z] = toScene(core.frame, p);
      const row = (r: number): number => [x, y, z, 1].reduce((s, v, k) => s + v * camera.worldToCamera[4 * r + k], 0);
      const share = view.clientWidth / camera.width;
      return {
        x: share * ((camera.fx * row(0)) / row(2) + camera.cx),
        y: share * ((camera.fy * row(1)) / row(2) + camera.cy),
      };
    };
    for (const [place, aside, what] of [
      [[-2, -2, -2], [4, 3], 'corner'],
      [[-2, -2, -0.8], [0, -6], 'edge'],
    ] as const) {
      const { x, y } = at(place);
      const point = await core.positionFromPoint(left + x + aside[0], top + y + aside[1], edges);
      assert(point, `nothing at the ${what}`);
      const off =
        what === 'corner' ? Math.hypot(point.x + 2, point.y + 2, point.z + 2) : Math.hypot(point.x + 2, point.y + 2);
      assert(off < 0.06, `${what}: ${off} m off, at ${point.toString()}`);
      const plain = await element.positionFromPoint(left + x + aside[0], top + y + aside[1]);
      assert(Math.hypot(plain!.x - point.x, plain!.y - point.y, plain!.z - point.z) > 0.02, `${what}: not moved`);
    }
  });

  it('is put away by Escape without closing the dialog around the scene', async () => {
    const element = await ruler({});
    const dialog = document.createElement('dialog');
    document.body.append(dialog);
    dialog.append(element);
    dialog.showModal();
    await until(() => button(element) !== null, 'the button');
    button(element)!.focus();
    await sendKeys({ press: 'Enter' });
    const isOut = (): boolean => element.shadowRoot!.querySelector('.ruler') !== null;
    await until(isOut, 'the ruler');
    await sendKeys({ press: 'Escape' });
    await until(() => !isOut(), 'the end of the ruler');
    assert(dialog.open, 'the dialog is closed');
    await sendKeys({ press: 'Escape' });
    await until(() => !dialog.open, 'the end of the dialog');
  });

  it('announces that there is no surface, each time', async () => {
    const element = await ruler({ 'camera-orbit': '0deg 90deg 7m', 'camera-target': '0m 30m 0m' });
    button(element)!.click();
    const view = element.shadowRoot!.querySelector<HTMLElement>('#view')!;
    const texts = new Set<string>();
    const region = element.shadowRoot!.querySelector('[role=status]')!;
    for (const count of [1, 2]) {
      view.dispatchEvent(new KeyboardEvent('keydown', { key: 'Enter', code: 'Enter', bubbles: true }));
      await until(() => {
        if (region.textContent.startsWith('No surface here')) texts.add(region.textContent);
        return texts.size === count;
      }, `announcement ${count}`);
    }
  });
});
