/** `renderDepth()`: depth, coverage and the element of each pixel, against positions that picks find. */
import '@gaussian-splat/element';
import type { GaussianSplatElement, MeasuredView } from '@gaussian-splat/element';
import type { SplatSceneElement } from '@gaussian-splat/element/scenes.js';
import { itInLab, isLab } from '../../support/extent-in-pages.js';
import { assert, assertEqual, COMPASS, FIXTURES, showLoaded } from './support/harness.js';

const GREEN = `${FIXTURES}green.splat`;
const VIEW = {
  ...{ alt: 'A compass', 'camera-orbit': '20deg 80deg 7m', 'camera-target': '0 0 0', 'field-of-view': '45deg' },
  ...{ quality: 'default', 'interaction-prompt': 'none' },
};
const SIZE = 'width: 120px; height: 100px';
/** Pixels between two picks, which read from the GPU each. */
const STEP = isLab ? 6 : 9;

/** Compares the pixels of an image of the element's own size with picks, and returns the number of both. */
async function pickedPixels(element: GaussianSplatElement, view: MeasuredView, isParallel = false): Promise<number> {
  const box = element.getBoundingClientRect();
  const { width, height, camera, depth, ids, owners } = view;
  let [picked, others, far] = [0, 0, 0];
  for (let y = 3; y < height; y += STEP) {
    for (let x = 3; x < width; x += STEP) {
      const pixel = y * width + x;
      const [across, down] = [(x + 0.5) / width, (y + 0.5) / height];
      const hit = await element.positionFromPoint(box.left + across * box.width, box.top + down * box.height);
      if (hit === null || depth[pixel] === 0) continue;
      picked++;
      const slant = isParallel
        ? 1
        : Math.hypot(1, (x + 0.5 - camera.cx) / camera.fx, (y + 0.5 - camera.cy) / camera.fy);
      const found = depth[pixel] * slant;
      if (!isParallel && Math.abs(found - hit.distance) >= 0.05) far++;
      if (owners[ids[pixel] - 1] !== hit.element) others++;
    }
  }
  // A pick has the surface around it, which may be another one at an edge.
  assert(far <= picked / 20, `${far} of ${picked} picks are 5 cm from the depth of their pixel, or more`);
  // A pick has the element of the splat at the median depth, which may be another one at the edge of two.
  assert(others <= picked / 20, `${others} of ${picked} pixels have another element`);
  return picked;
}

describe('renderDepth()', () => {
  itInLab('has the depths and elements that picks find, of the element and its children', async () => {
    const element = await showLoaded({ ...VIEW, src: COMPASS }, SIZE);
    const child = Object.assign(document.createElement('splat-scene'), { src: GREEN });
    child.setAttribute('position', '2m 0 0.5m');
    const loaded = new Promise((resolve) => child.addEventListener('load', resolve));
    element.append(child);
    await loaded;
    const view = await element.renderDepth();
    assert(view.owners[0] === element && view.owners[1] === child, 'owners');
    for (const map of [view.depth, view.expectedDepth, view.coverage, view.ids])
      assertEqual(map.length, view.width * view.height);
    const picked = await pickedPixels(element, view);
    assert(picked > 180 / STEP ** 2, `${picked} picks`);
    for (const id of [1, 2]) assert(view.ids.includes(id), `pixels of owner ${id}`);
    child.hidden = true;
    await (child as SplatSceneElement).updateComplete;
    const without = await element.renderDepth({ width: 60 });
    assertEqual(
      [without.width, without.height, without.owners.length],
      [60, 50, 1],
      'a smaller view without the child',
    );
    assert(without.owners[0] === element, 'owner of the smaller view');
  });

  itInLab('follows parallel rays, and leaves the page as it was', async () => {
    const element = await showLoaded({ ...VIEW, src: COMPASS, orthographic: '' }, SIZE);
    const before = element.toDataURL();
    const view = await element.renderDepth();
    assert(view.camera.orthographic === true, 'parallel rays');
    const picked = await pickedPixels(element, view, true);
    assert(picked > 180 / STEP ** 2, `${picked} picks`);
    assertEqual(element.toDataURL(), before, 'the image of the page');
  });

  it('refuses by name: a size, an element without a scene, and WebGL', async () => {
    const refused = async (element: GaussianSplatElement, name: RegExp, options = {}): Promise<void> => {
      const error: unknown = await element.renderDepth(options).catch((reason: unknown) => reason);
      assert(name.test(`${(error as Error).name} ${(error as Error).message}`), String(error));
    };
    const element = await showLoaded({ ...VIEW, src: COMPASS }, SIZE);
    await refused(element, /^RangeError renderDepth\(\): expected an image of 1 to/, { width: 1e6 });
    await refused(document.createElement('gaussian-splat'), /^InvalidStateError/);
    const gl = await showLoaded({ ...VIEW, src: COMPASS, renderer: 'webgl' }, SIZE);
    await refused(gl, /unsupported\/webgl/);
  });
});
