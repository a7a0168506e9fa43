/** Orthographic views: picked points match their pixels at any depth, on splats and on meshes. */
import '@gaussian-splat/element/scenes.js';
import type { GaussianSplatElement } from '@gaussian-splat/element';
import type { SplatMeshElement, SplatSceneElement } from '@gaussian-splat/element/scenes.js';
import { boxGlb } from './support/glb.js';
import { assert, atRest, COMPASS, FIXTURES, showLoaded, until } from './support/harness.js';

const SIZE = { width: 200, height: 160 };
const STYLE = `width: ${SIZE.width}px; height: ${SIZE.height}px`;
const VIEW = {
  alt: 'A compass',
  orthographic: '',
  'interaction-prompt': 'none',
  'camera-orbit': '0deg 90deg 8m',
  'camera-target': '0m 0m 0m',
  'field-of-view': '40deg',
};
const GREEN = `${FIXTURES}green.splat`;
/** Viewer units of a pixel. */
const SCALE = (2 * 8 * Math.tan((20 * Math.PI) / 180)) / SIZE.height;

interface Picked {
  readonly x: number;
  readonly y: number;
  readonly z: number;
  readonly off: number;
  readonly mesh: string | null;
}

/** Points picked under pixels, and their distances to the expected parallel rays. */
async function pick(element: GaussianSplatElement): Promise<Picked[]> {
  const { left, top } = element.getBoundingClientRect();
  const picked: Picked[] = [];
  for (let x = 20; x < SIZE.width; x += 20)
    for (let y = 20; y < SIZE.height; y += 20) {
      const point = await element.positionFromPoint(left + x, top + y);
      if (point === null) continue;
      const expected = [(x - SIZE.width / 2) * SCALE, (SIZE.height / 2 - y) * SCALE];
      const off = Math.hypot(point.x - expected[0], point.y - expected[1]);
      picked.push({ x: point.x, y: point.y, z: point.z, off, mesh: point.mesh });
    }
  return picked;
}

const farthestOff = (picked: readonly Picked[]): number => Math.max(...picked.map(({ off }) => off));

describe('orthographic', () => {
  it('shows splats and meshes as large at any depth', async () => {
    const element = await showLoaded({ src: COMPASS, ...VIEW }, STYLE);
    const near = Object.assign(document.createElement('splat-scene') as SplatSceneElement, { src: GREEN });
    const box = document.createElement('splat-mesh') as SplatMeshElement;
    near.position = [-2, 2, 3];
    Object.assign(box, { src: boxGlb({ half: [0.6, 0.6, 0.6] }), position: [2, 1.5, 3] });
    element.append(near, box);
    await until(() => near.loaded && box.loaded, `both, with ${box.error?.message ?? ''}`);
    await atRest(element);
    const picked = await pick(element);
    assert(picked.length >= 4, `${picked.length} points`);
    assert(
      picked.some(({ mesh, z }) => mesh !== null && Math.abs(z - 3.6) < 0.01),
      'the face of the box',
    );
    assert(
      picked.some(({ mesh, z }) => mesh === null && z > 2),
      'the scene that is near',
    );
    assert(farthestOff(picked) < 0.01, `${farthestOff(picked)} m off`);

    element.orthographic = false;
    await element.updateComplete;
    await atRest(element);
    const perspective = await pick(element);
    assert(farthestOff(perspective) > 0.3, `with perspective ${farthestOff(perspective)} m off`);
  });

  it('does so with WebGL, and zooms', async () => {
    const element = await showLoaded({ src: COMPASS, ...VIEW, renderer: 'webgl' }, STYLE);
    const picked = await pick(element);
    assert(picked.length > 0 && farthestOff(picked) < 0.01, `${picked.length} points, ${farthestOff(picked)} m off`);
    element.cameraOrbit = '0deg 90deg 4m';
    element.jumpCameraToGoal();
    await atRest(element);
    const larger = await pick(element);
    assert(larger.length > picked.length, `${larger.length} points of ${picked.length} before`);
  });
});
