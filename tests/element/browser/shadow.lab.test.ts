/** The shadow on the ground: its position and darkness, created once, and hidden from below. */
import '@gaussian-splat/element';
import type { GaussianSplatElement } from '@gaussian-splat/element';
import { boxGlb } from './support/glb.js';
import { assert, assertEqual, atRest, delay, showLoaded, submits, until } from './support/harness.js';
import { screenOf } from './support/screen.js';

/** A white ball of many splats, 1 m wide, as a `.splat`: y down. */
function ball(): string {
  const rows = new Float32Array(8 * 2000);
  const bytes = new Uint8Array(rows.buffer);
  for (let i = 0; i < 2000; i++) {
    const y = 1 - (2 * (i + 0.5)) / 2000;
    const [angle, ring] = [2.399963 * i, Math.sqrt(1 - y * y)];
    rows.set([0.5 * ring * Math.cos(angle), 0.5 * y, 0.5 * ring * Math.sin(angle), 0.03, 0.03, 0.03], 8 * i);
    bytes.set([255, 255, 255, 255, 255, 128, 128, 128], 32 * i + 24);
  }
  return `${URL.createObjectURL(new Blob([rows]))}#ball.splat`;
}

const STILL = {
  ...{ 'interpolation-decay': '0', 'interaction-prompt': 'none', 'camera-target': '0 0 0', quality: 'default' },
  ...{ 'camera-orbit': '0deg 65deg 4m', 'field-of-view': '45deg', 'min-camera-orbit': 'auto 0deg auto' },
  'max-camera-orbit': 'auto 180deg auto',
};

async function shown(
  attributes: Readonly<Record<string, string>>,
  ground = 'rgb(200 200 200)',
): Promise<GaussianSplatElement> {
  const style = `width: 200px; height: 160px; background: ${ground}`;
  return showLoaded({ src: ball(), ...STILL, ...attributes }, style);
}

/** Lightness of a point of viewer space on the ground, from the default view of these tests. */
async function lightAt(element: GaussianSplatElement, x: number, z: number, y = -0.5): Promise<number> {
  const phi = (65 * Math.PI) / 180;
  const [up, away] = [y * Math.sin(phi) - z * Math.cos(phi), 4 - y * Math.cos(phi) - z * Math.sin(phi)];
  const focal = 80 / Math.tan(Math.PI / 8);
  const [r, g, b] = (await screenOf(element)).at(100 + (focal * x) / away, 80 - (focal * up) / away);
  return (r + g + b) / 3;
}

const hasShadow = async (element: GaussianSplatElement): Promise<boolean> => (await lightAt(element, 0.35, 0.35)) < 185;

async function untilShadow(element: GaussianSplatElement): Promise<void> {
  const end = performance.now() + 30_000;
  while (!(await hasShadow(element))) {
    assert(performance.now() < end, 'a shadow');
    await delay(100);
  }
  await atRest(element);
}

describe('shadow-intensity', () => {
  for (const renderer of ['webgpu', 'webgl'])
    it(`${renderer}: a soft shadow lies under the subject, darkest where it stands`, async () => {
      const element = await shown({ 'shadow-intensity': '1', renderer });
      await untilShadow(element);
      const near = await lightAt(element, 0.25, 0.25);
      const middle = await lightAt(element, 0.5, 0.3);
      const beside = await lightAt(element, 1.2, 0.3);
      assert(near < middle - 10 && middle < beside, `${near}, ${middle}, ${beside} from its middle outward`);
      assert(Math.abs(beside - 200) < 3, `${beside} beside it`);
      assert(near > 30, `${near}: a shadow, not a hole`);
      const before = submits;
      await delay(600);
      assertEqual(submits - before, 0, 'frames of a page that rests');
      element.setAttribute('camera-orbit', '0deg 150deg 4m');
      await atRest(element);
      const image = await screenOf(element);
      const [red] = image.at(30, 20);
      assert(Math.abs(red - 200) < 3, `${red}: seen from below there is none`);
    });

  it('is as dark as the attribute says, none without it, and no frame more', async () => {
    const element = await shown({ 'shadow-intensity': '1' });
    await untilShadow(element);
    const dark = await lightAt(element, 0.35, 0.35);
    element.setAttribute('shadow-intensity', '0.5');
    const end = performance.now() + 30_000;
    let half = dark;
    while (half < dark + 10 && performance.now() < end) half = await lightAt(element, 0.35, 0.35);
    assert(Math.abs(200 - half - (200 - dark) / 2) < 12, `${half} in place of half of ${dark}`);
    element.removeAttribute('shadow-intensity');
    await delay(300);
    await atRest(element);
    const none = await lightAt(element, 0.35, 0.35);
    assert(Math.abs(none - 200) < 3, `${none} without`);
  });

  it('is of what cuts leave', async () => {
    const element = await shown({ 'shadow-intensity': '1' });
    await untilShadow(element);
    const dark = await lightAt(element, 0.35, 0.35);
    const cut = document.createElement('splat-cut');
    cut.setAttribute('scale', '100');
    element.append(cut);
    const end = performance.now() + 30_000;
    let light = dark;
    while (light < 197 && performance.now() < end) light = await lightAt(element, 0.35, 0.35);
    assert(light >= 197, `${light} under nothing, ${dark} before`);
  });

  it('is cast by meshes, and cannot be picked', async () => {
    const element = await shown({ 'shadow-intensity': '1' });
    const box = document.createElement('splat-mesh');
    Object.assign(box, { src: boxGlb({ half: [0.3, 0.3, 0.3] }), position: [1.2, -0.2, 0] });
    element.append(box);
    await until(() => box.loaded, 'the box');
    const end = performance.now() + 30_000;
    let light = 200;
    while (light > 190 && performance.now() < end) light = await lightAt(element, 1.2, 0.36);
    assert(light <= 190, `${light} before the box`);
    await atRest(element);
    const { left, top } = element.getBoundingClientRect();
    assertEqual(await element.positionFromPoint(left + 100, top + 150), null, 'the ground before the ball');
  });
});
