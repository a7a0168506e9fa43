/** AR with an emulated phone in an emulated room: where the subject stands, how large it is, and what iPhones get. */
import '@gaussian-splat/element';
import type { GaussianSplatElement } from '@gaussian-splat/element';
import { GlRenderer } from '@gaussian-splat/renderer/webgl';
import { itInLab } from '../../support/extent-in-pages.js';
import { headset } from './support/headset.js';
import { assert, assertEqual, COMPASS, frames, showLoaded, until } from './support/harness.js';

const STILL = { 'interpolation-decay': '0', 'interaction-prompt': 'none' };
const LIMIT_MS = 3_000;
const PLANE = 0.3;

interface Session {
  end(): Promise<void>;
}
let session: Session | undefined;

/** The floor of the room: hits of the ray from the eyes, 20 degrees down. */
function room(): void {
  const { XRSession, XRFrame } = globalThis as unknown as Record<string, { prototype: Record<string, unknown> }>;
  XRSession.prototype.requestHitTestSource = () => Promise.resolve({ cancel: () => undefined });
  XRFrame.prototype.getHitTestResults = () => [
    {
      getPose: () => ({
        transform: {
          position: { x: 0.2, y: PLANE, z: -1.5 },
          matrix: Float32Array.from([1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0.2, PLANE, -1.5, 1]),
        },
      }),
    },
  ];
}

/** An element whose object is placed, and the scene's frame to that of the view. */
async function start(
  attributes: Readonly<Record<string, string>>,
  prepare: (element: GaussianSplatElement) => void = () => undefined,
): Promise<[GaussianSplatElement, ArrayLike<number>]> {
  // The emulator draws two views; those of a phone are at one place.
  headset().device.ipd = 0;
  room();
  const xr = (navigator as unknown as { xr: { requestSession: unknown; isSessionSupported: unknown } }).xr;
  xr.isSessionSupported = () => Promise.resolve(true);
  const asked = (xr.requestSession as (mode: string, options: object) => Promise<Session>).bind(xr);
  xr.requestSession = (mode: string, options: object) => {
    assertEqual(mode, 'immersive-ar', 'mode');
    assert(JSON.stringify(options).includes('hit-test'), JSON.stringify(Object.keys(options)));
    return asked('immersive-ar', { optionalFeatures: ['local-floor'] }).then((begun) => (session = begun));
  };
  const { render } = GlRenderer.prototype;
  let camera: { worldToCamera: ArrayLike<number> } | undefined;
  GlRenderer.prototype.render = function (request, quads) {
    if (request.shDegree > 0) ({ camera } = request);
    render.call(this, request, quads);
  };
  try {
    const element = await showLoaded({ src: COMPASS, ar: '', ...STILL, ...attributes });
    prepare(element);
    const button = (): HTMLButtonElement | null => element.shadowRoot!.querySelector('[part=ar-button]');
    await until(() => button() !== null, 'the button', LIMIT_MS);
    button()!.click();
    await until(() => element.getAttribute('ar-status') === 'object-placed', 'a place', LIMIT_MS);
    await until(() => camera !== undefined, 'a picture', LIMIT_MS);
    return [element, camera!.worldToCamera];
  } finally {
    Object.assign(GlRenderer.prototype, { render });
    xr.requestSession = asked;
  }
}

/** A point of the scene in the room: the phone stands at the origin of its floor, 1.6 m high, and looks ahead. */
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
    const { bounds } = (element as unknown as { core: { camera: { bounds: { center: number[]; radius: number } } } })
      .core.camera;
    const size = Math.hypot(m[0], m[1], m[2]);
    assert(Math.abs(size / 0.1 - 1) < 1e-3, `${size} m for a unit`);
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
    assert(Math.abs(lowest - PLANE) < 0.01, `lowest splats at ${lowest}`);
    const middle = inRoom(m, bounds.center);
    assert(Math.hypot(middle[0] - 0.2, middle[2] + 1.5) < 0.02, `middle at ${middle}`);
    element.exitXR!();
    await until(() => element.getAttribute('ar-status') === 'not-presenting', 'an end', LIMIT_MS);
  });

  itInLab('is 0.5 to 1 m large at first where no size is known', async () => {
    const [element, m] = await start({});
    const { bounds } = (element as unknown as { core: { camera: { bounds: { radius: number } } } }).core.camera;
    const size = 2 * bounds.radius * Math.hypot(m[0], m[1], m[2]);
    assert(size > 0.45 && size < 1.05, `${size} m`);
    element.exitXR!();
    await until(() => element.getAttribute('ar-status') === 'not-presenting', 'an end', LIMIT_MS);
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
    const { bounds } = (element as unknown as { core: { camera: { bounds: { center: number[] } } } }).core.camera;
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
      const other = await showLoaded({ src: COMPASS, ar: '', ...STILL });
      await frames(4);
      assertEqual(other.shadowRoot!.querySelector('a[rel=ar], [part=ar-button]'), null, 'without a model');
    } finally {
      Object.defineProperty(navigator, 'userAgent', userAgent);
      Reflect.deleteProperty(navigator, 'userAgent');
    }
  });
});
