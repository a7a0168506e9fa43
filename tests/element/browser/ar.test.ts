/** AR with an emulated phone in an emulated room: the position and size of the subject, and the file for iPhones. */
import { insideOf } from './support/inside.js';
import '@gaussian-splat/element';
import type { GaussianSplatElement } from '@gaussian-splat/element';
import { GlRenderer } from '@gaussian-splat/renderer/webgl';
import { itInLab } from '../../support/extent-in-pages.js';
import { headset } from './support/headset.js';
import { assert, assertEqual, COMPASS, frames, showLoaded, until } from './support/harness.js';

const STILL = { 'interpolation-decay': '0', 'interaction-prompt': 'none' };
const LIMIT_MS = 30_000;
const PLANE = 0.3;

interface Session {
  end(): Promise<void>;
}
let session: Session | undefined;

interface Hit {
  readonly at: readonly number[];
  /** Normal of the surface. Default: upwards. */
  readonly normal?: readonly number[];
}
const FLOOR: Hit = { at: [0.2, PLANE, -1.5] };

const classes = globalThis as unknown as Record<string, { prototype: Record<string, unknown> }>;

/** The surfaces of the room that the ray from the eyes hits. */
function room(hits: readonly Hit[]): void {
  const { XRSession, XRFrame } = classes;
  XRSession.prototype.requestHitTestSource = () => Promise.resolve({ cancel: () => undefined });
  XRFrame.prototype.getHitTestResults = () =>
    hits.map(({ at: [x, y, z], normal = [0, 1, 0] }) => ({
      getPose: () => ({
        transform: {
          position: { x, y, z },
          matrix: Float32Array.from([1, 0, 0, 0, ...normal, 0, 0, 0, 1, 0, x, y, z, 1]),
        },
      }),
    }));
}

/** Puts fingers on the screen, at points of the room that they cover. */
function touch(points: readonly (readonly number[])[]): void {
  const { XRSession, XRFrame } = classes;
  const matrices = points.map((point) => {
    const way = [point[0], point[1] - 1.6, point[2]];
    const back = way.map((value) => -value / Math.hypot(...way));
    return Float32Array.from([1, 0, 0, 0, 0, 1, 0, 0, ...back, 0, 0, 1.6, 0, 1]);
  });
  fingers = matrices.map((matrix) => ({ handedness: 'none', targetRayMode: 'screen', targetRaySpace: { matrix } }));
  if (isTouchable) return;
  isTouchable = true;
  Object.defineProperty(XRSession.prototype, 'inputSources', { configurable: true, get: () => fingers });
  const getPose = XRFrame.prototype.getPose as (space: { matrix?: Float32Array }, base: object) => object;
  XRFrame.prototype.getPose = function (space: { matrix?: Float32Array }, base: object) {
    return space.matrix ? { transform: { matrix: space.matrix } } : getPose.call(this, space, base);
  };
}
let fingers: readonly object[] = [];
let isTouchable = false;

/** The transform from the scene's frame to that of the view in the next frame. */
async function nextView(): Promise<ArrayLike<number>> {
  const { render } = GlRenderer.prototype;
  let camera: { worldToCamera: ArrayLike<number> } | undefined;
  GlRenderer.prototype.render = function (request, quads) {
    if (request.shDegree > 0) ({ camera } = request);
    return render.call(this, request, quads);
  };
  try {
    await until(() => camera !== undefined, 'an image', LIMIT_MS);
    return camera!.worldToCamera;
  } finally {
    Object.assign(GlRenderer.prototype, { render });
  }
}

/** An element whose object is placed, and the scene's frame to that of the view. */
async function start(
  attributes: Readonly<Record<string, string>>,
  prepare: (element: GaussianSplatElement) => void = () => undefined,
  hits: readonly Hit[] = [FLOOR],
): Promise<[GaussianSplatElement, ArrayLike<number>]> {
  // The emulator draws two views; those of a phone are at one place.
  headset().device.ipd = 0;
  room(hits);
  const xr = (navigator as unknown as { xr: { requestSession: unknown; isSessionSupported: unknown } }).xr;
  xr.isSessionSupported = () => Promise.resolve(true);
  const asked = (xr.requestSession as (mode: string, options: object) => Promise<Session>).bind(xr);
  xr.requestSession = (mode: string, options: object) => {
    assertEqual(mode, 'immersive-ar', 'mode');
    assert(JSON.stringify(options).includes('hit-test'), JSON.stringify(Object.keys(options)));
    return asked('immersive-ar', { optionalFeatures: ['local-floor'] }).then((begun) => (session = begun));
  };
  try {
    const element = await showLoaded({ src: COMPASS, ar: '', ...STILL, ...attributes });
    prepare(element);
    const button = (): HTMLButtonElement | null => element.shadowRoot!.querySelector('[part=ar-button]');
    await until(() => button() !== null, 'the button', LIMIT_MS);
    button()!.click();
    const status = (): string => element.getAttribute('ar-status') ?? '';
    await until(() => ['object-placed', 'failed'].includes(status()), 'a place', LIMIT_MS);
    assertEqual(status(), 'object-placed', 'status');
    return [element, await nextView()];
  } finally {
    xr.requestSession = asked;
  }
}

/** A point of the scene in the room: the phone stands at the origin of its floor, 1.6 m high, and faces forward. */
function inRoom(m: ArrayLike<number>, [x, y, z]: readonly number[]): number[] {
  const row = (r: number): number => m[4 * r] * x + m[4 * r + 1] * y + m[4 * r + 2] * z + m[4 * r + 3];
  return [row(0), 1.6 - row(1), -row(2)];
}

describe('AR', () => {
  // Before the page is cleared: the emulator has a canvas in it.
  afterEach(async () => {
    await session?.end().catch(() => undefined);
    session = undefined;
  });

  itInLab('stands on the plane, front to the person, in its true size', async () => {
    const [element, m] = await start({ 'ar-scale': 'fixed', unit: '10cm' });
    const { bounds } = insideOf(element).camera;
    const size = Math.hypot(m[0], m[1], m[2]);
    assert(Math.abs(size / 0.1 - 1) < 1e-5, `${size} m for a unit`);
    const { readScene, fetchScene } = await import('@gaussian-splat/formats');
    const cloud = await readScene(await fetchScene(COMPASS), { name: 'compass.splat' });
    const heights = [];
    for (let i = 0; i < cloud.count; i++) {
      const p = [0, 1, 2].map((k) => cloud.positions[3 * i + k] + cloud.origin[k]);
      const away = Math.hypot(...p.map((value, k) => value - bounds.center[k]));
      if (away <= bounds.radius) heights.push(inRoom(m, p)[1]);
    }
    heights.sort((a, b) => a - b);
    const lowest = heights[Math.floor(0.01 * heights.length)];
    assert(Math.abs(lowest - PLANE) < 1e-5, `lowest splats at ${lowest}`);
    const middle = inRoom(m, bounds.center);
    const beside = Math.hypot(middle[0] - 0.2, middle[2] + 1.5);
    const [up, aside, longer] = [lowest - PLANE, beside, size / 0.1 - 1].map((value) => (1000 * value).toFixed(2));
    console.log(`AR: ${up} mm above the plane, ${aside} mm beside the hit, ${longer} mm too long for each meter`);
    assert(beside < 1e-5, `middle at ${middle}`);
    element.exitXR!();
    await until(() => element.getAttribute('ar-status') === 'not-presenting', 'an end', LIMIT_MS);
  });

  for (const name of ['product', 'walker'])
    itInLab(`${name}: the floor of a scene that was trained from images is on the plane`, async () => {
      const attributes = { src: `/demo/scenes/studio/${name}.spz`, 'ar-scale': 'fixed', unit: '1m' };
      const [element, m] = await start(attributes);
      const [x, , z] = insideOf(element).camera.bounds.center;
      // The floors of the studio have the height 0.
      const above = inRoom(m, [x, 0, z])[1] - PLANE;
      console.log(`AR, ${name}: the true floor is ${(100 * above).toFixed(1)} cm above the plane`);
      assert(Math.abs(above) < 0.05, `${above} m above the plane`);
      element.exitXR!();
      await until(() => element.getAttribute('ar-status') === 'not-presenting', 'an end', LIMIT_MS);
    });

  itInLab('is 0.5 to 1 m large at first where no size is known', async () => {
    const [element, m] = await start({});
    const { bounds } = insideOf(element).camera;
    const size = 2 * bounds.radius * Math.hypot(m[0], m[1], m[2]);
    assert(size > 0.45 && size < 1.05, `${size} m`);
    element.exitXR!();
    await until(() => element.getAttribute('ar-status') === 'not-presenting', 'an end', LIMIT_MS);
  });

  itInLab('stands on a floor behind a wall, hangs at a wall behind a floor, and else takes what there is', async () => {
    const wall: Hit = { at: [0, 1.2, -1], normal: [0, 0, 1] };
    for (const [attributes, hits, z] of [
      [{}, [wall, FLOOR], FLOOR.at[2]],
      [{ 'ar-placement': 'wall' }, [FLOOR, wall], wall.at[2]],
      [{}, [wall], wall.at[2]],
    ] as const) {
      const [element, m] = await start(attributes as Record<string, string>, undefined, hits);
      const { bounds } = insideOf(element).camera;
      const ahead = 'ar-placement' in attributes ? bounds.radius * Math.hypot(m[0], m[1], m[2]) : 0;
      const middle = inRoom(m, bounds.center);
      assert(Math.abs(middle[2] - z - ahead) < 0.03, `${middle} in place of ${z}`);
      element.exitXR!();
      await until(() => element.getAttribute('ar-status') === 'not-presenting', 'an end', LIMIT_MS);
      element.remove();
    }
  });

  itInLab('follows fingers: a slow pinch leaves true size, and a drag moves along the wall', async () => {
    const [element, m] = await start({ unit: '30cm' });
    const sizeOf = (view: ArrayLike<number>): number => Math.hypot(view[0], view[1], view[2]) / 0.3;
    assert(Math.abs(sizeOf(m) - 1) < 1e-3, `true size, ${sizeOf(m)}`);
    const [, y, z] = FLOOR.at;
    for (let apart = 0.2; apart < 0.3; apart *= 1.01) {
      touch([[-apart / 2, y, z], [apart / 2, y, z]]); // prettier-ignore
      await frames(1);
    }
    touch([]);
    const size = sizeOf(await nextView());
    assert(size > 1.3, `${size} after a pinch by half`);
    element.exitXR!();
    await until(() => element.getAttribute('ar-status') === 'not-presenting', 'an end', LIMIT_MS);
    element.remove();

    const wall: Hit = { at: [0, 1.6, -2], normal: [0, 0, 1] };
    const [other, before] = await start({ 'ar-placement': 'wall' }, undefined, [wall]);
    const { bounds } = insideOf(other).camera;
    for (let moved = 0; moved < 0.41; moved += 0.1) {
      touch([[moved, 1.6 + moved / 2, -2]]);
      await frames(2);
    }
    touch([]);
    const [from, to] = [inRoom(before, bounds.center), inRoom(await nextView(), bounds.center)];
    const by = to.map((value, k) => value - from[k]);
    assert(Math.hypot(by[0] - 0.4, by[1] - 0.2, by[2]) < 0.01, `moved by ${by}`);
    other.exitXR!();
    await until(() => other.getAttribute('ar-status') === 'not-presenting', 'an end', LIMIT_MS);
  });

  itInLab('says so if the room is not searched', async () => {
    let element: GaussianSplatElement | undefined;
    const began = start({}, (shown) => {
      element = shown;
      classes.XRSession.prototype.requestHitTestSource = () =>
        Promise.reject(new DOMException('no room', 'OperationError'));
    });
    assert(
      await began.then(
        () => false,
        () => true,
      ),
      'an object is placed in a room that is not searched',
    );
    assertEqual(element?.getAttribute('ar-status'), 'failed', 'status');
  });

  itInLab("the element's labels stand over the camera's image at their points, and return to the page", async () => {
    const label = Object.assign(document.createElement('button'), { slot: 'hotspot-top', textContent: 'Top' });
    const [element, m] = await start({}, (shown) => {
      const { x, y, z } = shown.getCameraTarget();
      label.dataset.position = `${x} ${y} ${z}`;
      shown.append(label);
    });
    const overlay = element.shadowRoot!.querySelector('.ar-overlay')!;
    await until(() => label.assignedSlot?.closest('.ar-overlay') === overlay, 'a place in the overlay', LIMIT_MS);
    await frames(4);
    const box = label.getBoundingClientRect();
    const around = overlay.getBoundingClientRect();
    const at = [(box.x + box.width / 2 - around.x) / around.width, (box.y + box.height / 2 - around.y) / around.height];
    const { bounds } = insideOf(element).camera;
    const row = (r: number): number =>
      bounds.center.reduce((sum, value, k) => sum + m[4 * r + k] * value, m[4 * r + 3]);
    const [x, y, z] = [row(0), row(1), row(2)];
    // Off-center eyes of 160 by 168 pixels: 52 degrees to one side, 42 to the other; 46 up, 50 down.
    const tan = (degrees: number): number => Math.tan((degrees * Math.PI) / 180);
    const seen = [
      [52, 42],
      [42, 52],
    ].map(([l, r]) => (x / z + tan(l)) / (tan(l) + tan(r)));
    const up = (y / z + tan(46)) / (tan(46) + tan(50));
    assert(
      seen.some((own) => Math.abs(own - at[0]) < 0.02),
      `${at[0]} across, ${seen.join(' or ')} expected`,
    );
    assert(Math.abs(up - at[1]) < 0.02, `${at[1]} down, ${up} expected`);
    element.exitXR!();
    await until(() => element.getAttribute('ar-status') === 'not-presenting', 'an end', LIMIT_MS);
    assert(label.assignedSlot?.closest('#hotspots'), 'the label is back in the page');
  });

  itInLab('on iPhones is a link to the model of the author, by its honest name; else nothing', async () => {
    headset();
    const { xr } = navigator as unknown as { xr: { isSessionSupported: unknown } };
    xr.isSessionSupported = () => Promise.resolve(false);
    const userAgent = Object.getOwnPropertyDescriptor(Navigator.prototype, 'userAgent')!;
    Object.defineProperty(navigator, 'userAgent', {
      configurable: true,
      value: 'Mozilla/5.0 (iPhone; CPU iPhone OS 26_0)',
    });
    try {
      const element = await showLoaded({ src: COMPASS, ar: '', 'ios-src': 'compass.usdz', ...STILL });
      const link = (): HTMLAnchorElement | null => element.shadowRoot!.querySelector('a[rel=ar]');
      await until(() => link() !== null, 'the link', LIMIT_MS);
      assert(link()!.href.endsWith('/compass.usdz'), link()!.href);
      assertEqual(link()!.querySelector('img')!.alt, 'View a simplified model in AR', 'its name');
      element.setAttribute('ios-splats', 'compass-ar.usdz');
      await frames(4);
      assert(link()!.href.endsWith('/compass.usdz'), 'a system that draws no splats has the mesh');
      Object.assign(globalThis, { HTMLModelElement: class {} });
      element.requestUpdate();
      await until(() => link()!.href.endsWith('/compass-ar.usdz'), 'the splats', LIMIT_MS);
      element.setAttribute('ios-splats', 'javascript:alert(1)');
      await until(() => link()!.href.endsWith('/compass.usdz'), 'the mesh in place of code', LIMIT_MS);
      element.setAttribute('ios-src', 'javascript:alert(1)');
      await until(() => link() === null, 'no link to code', LIMIT_MS);
      const other = await showLoaded({ src: COMPASS, ar: '', ...STILL });
      await frames(4);
      assertEqual(other.shadowRoot!.querySelector('a[rel=ar], [part=ar-button]'), null, 'without a model');
      other.innerHTML = '<a slot="ar-fallback" href="#phone">Open on a phone</a>';
      other.requestUpdate();
      await until(() => other.firstElementChild!.assignedSlot?.name === 'ar-fallback', 'the fallback', LIMIT_MS);
      assert((other.firstElementChild as HTMLElement).offsetHeight > 0, 'the fallback is visible');
      element.setAttribute('ios-src', 'compass.usdz');
      element.innerHTML = other.innerHTML;
      element.requestUpdate();
      await frames(4);
      assertEqual(element.firstElementChild!.assignedSlot, null, 'the fallback beside the link');
    } finally {
      Object.defineProperty(navigator, 'userAgent', userAgent);
      Reflect.deleteProperty(navigator, 'userAgent');
      Reflect.deleteProperty(globalThis, 'HTMLModelElement');
    }
  });
});
