import '@gaussian-splat/element';
import type { ElementError, GaussianSplatElement } from '@gaussian-splat/element';
import { executeServerCommand } from '@web/test-runner-commands';
import { itInLab } from '../../support/extent-in-pages.js';
import {
  assert,
  assertEqual,
  COMPASS,
  delay,
  FIXTURES,
  frames,
  gated,
  nextEvent,
  printed,
  show,
  showLoaded,
  until,
} from './support/harness.js';
import { comesToShow, isBlue, isGreen, isRed, screenOf } from './support/screen.js';

const states = (element: GaussianSplatElement): string[] =>
  ['loading', 'ready', 'error', 'unsupported'].filter((state) => element.matches(`:state(${state})`));

/** The first element that a selector finds in the shadow tree, as it is when it is rendered: no event of the network comes between. */
const rendered = (element: GaussianSplatElement, selector: string): Promise<Element> =>
  new Promise((resolve) => {
    const look = (): void => {
      const found = element.shadowRoot!.querySelector(selector);
      if (found) resolve(found);
    };
    new MutationObserver(look).observe(element.shadowRoot!, { childList: true, subtree: true });
    look();
  });

/** Splats whose colors change a little with the direction: harmonics of degree 1, that 8 bits are enough for. */
function glossy(): string {
  const numbered = (name: string, count: number): string[] => Array.from({ length: count }, (_, i) => `${name}_${i}`);
  const colors = [...numbered('f_dc', 3), ...numbered('f_rest', 9)];
  const names = ['x', 'y', 'z', ...colors, 'opacity', ...numbered('scale', 3), ...numbered('rot', 4)];
  const rows = Array.from({ length: 50 }, (_, i) => {
    const place = [Math.sin(7 * i), Math.sin(11 * i), Math.sin(13 * i)];
    return [...place, ...colors.map((_, k) => 0.05 * Math.sin(i + 3 * k)), 2, -2, -2, -2, 1, 0, 0, 0].join(' ');
  });
  const head = ['ply', 'format ascii 1.0', 'element vertex 50', ...names.map((name) => `property float ${name}`)];
  return [...head, 'end_header', ...rows, ''].join('\n');
}

describe('a scene', () => {
  it("is drawn the right way round, on the page's own background", async () => {
    const element = await showLoaded({}, 'width: 120px; height: 120px; background: rgb(200, 100, 220)');
    const screen = await screenOf(element);
    const [red, blue, green] = [isRed, isBlue, isGreen].map((rule) => screen.middleOf(rule));
    assert(red && blue && green, 'three balls are seen');
    // The camera looks along +z of the file, from above: +x is right, -y is up.
    assert(red.x > 70 && blue.x < 50, `red ${red.x}, blue ${blue.x}`);
    assert(green.y < 50 && Math.abs(green.x - 60) < 3, `green ${green.x}, ${green.y}`);
    assertEqual(screen.at(2, 2), [200, 100, 220], 'background in the corner');
    const between = screen.at(60, 45);
    assert(Math.abs(between[0] - between[2]) < 60, `no color fringe at a half-transparent pixel: ${between.join()}`);
  });

  itInLab('asked for as reference after it was loaded has the colors of one that was loaded as such', async () => {
    const src = `${URL.createObjectURL(new Blob([glossy()]))}#glossy.ply`;
    const asked = await showLoaded({ src, quality: 'reference' });
    const element = await showLoaded({ src });
    const bytes = (): number => element.stats?.bytes.scene ?? 0;
    const rounded = bytes();
    element.cameraOrbit = '40deg 80deg 5m';
    element.jumpCameraToGoal();
    await frames();
    const orbit = String(element.getCameraOrbit());
    let events = 0;
    for (const type of ['loadstart', 'emptied', 'load', 'error']) element.addEventListener(type, () => events++);
    element.quality = 'reference';
    await until(() => bytes() > rounded, 'more exact colors', 30_000);
    assertEqual([bytes(), events, element.loaded], [asked.stats?.bytes.scene, 0, true], 'bytes, events, loaded');
    assertEqual(String(element.getCameraOrbit()), orbit, 'the camera');
    element.quality = 'default';
    await frames();
    assertEqual(bytes(), asked.stats?.bytes.scene, 'what is there stays');
  });

  it('fires first and last progress, then load, none of which bubbles', async () => {
    const seen: string[] = [];
    const onBody = (event: Event): void => void seen.push(`bubbled ${event.type}`);
    for (const type of ['load', 'progress', 'error', 'camera-change']) document.body.addEventListener(type, onBody);
    const { src, open } = gated('compass.ply', 400);
    const element = show({ src });
    const progress: ProgressEvent[] = [];
    element.addEventListener('progress', (event) => progress.push(event));
    element.addEventListener('load', (event) => seen.push(`load ${new URL(event.detail.url).pathname}`));
    await until(() => states(element).includes('loading'), 'the state loading');
    await open();
    await element.ready;
    await frames();
    assertEqual(seen, ['load /net/slow/compass.ply']);
    assertEqual(states(element), ['ready']);
    assert(
      progress.every((event) => event instanceof ProgressEvent),
      'ProgressEvents',
    );
    const [first, last] = [progress[0], progress[progress.length - 1]];
    assertEqual([first.loaded, first.lengthComputable], [0, false], 'first');
    assertEqual([last.loaded, last.total, last.lengthComputable], [693, 693, true], 'last');
    assert(progress.length >= 4, `several between, found ${progress.length}`);
    assertEqual(element.stats?.splats, 6, 'splats');
    assertEqual(element.stats?.dropped, 0, 'dropped');
    assert(element.loaded && element.error === null, 'loaded');
    for (const type of ['load', 'progress', 'error', 'camera-change']) document.body.removeEventListener(type, onBody);
  });

  it('has made no progress with what is not asked for yet', async () => {
    const element = await showLoaded();
    assertEqual(element.progress, 1);
    element.src = null;
    await element.updateComplete;
    assertEqual(element.progress, 0, 'without a scene');
    const isOut = nextEvent(element, 'model-visibility');
    element.style.display = 'none';
    await isOut;
    element.src = COMPASS;
    await frames(3);
    assertEqual([element.progress, element.loaded], [0, false], 'off-screen');
  });

  it('ends its progress also if the server does not report the length', async () => {
    const element = show({ src: '/net/unsized/compass.ply' });
    const progress: ProgressEvent[] = [];
    element.addEventListener('progress', (event) => progress.push(event));
    await element.ready;
    const last = progress[progress.length - 1];
    assertEqual([last.loaded, last.total, last.lengthComputable], [693, 693, true], 'last');
  });

  it('fires load once its pixels are on the screen', async () => {
    const element = show({ src: `${FIXTURES}green.splat`, poster: '' });
    await nextEvent(element, 'load');
    const screen = await screenOf(element);
    assert(isGreen(screen.at(60, 50)), `green in the middle, found ${screen.at(60, 50).join()}`);
  });

  it('shows a poster and a progress bar until then', async () => {
    const image = document.createElement('canvas');
    image.width = image.height = 4;
    const context = image.getContext('2d');
    assert(context, 'a 2D canvas');
    context.fillStyle = 'rgb(255, 0, 0)';
    context.fillRect(0, 0, 4, 4);
    const { src, open } = gated('green.splat');
    const element = show({ src, poster: image.toDataURL() }, 'width: 120px; height: 100px; --poster-transition: 0s');
    const bar = await rendered(element, '[role=progressbar]');
    assert(!bar.hasAttribute('aria-valuenow'), 'a progress bar without a value');
    assert(states(element).includes('loading'), 'the state loading');
    const isSeen = await comesToShow(element, (screen) => isRed(screen.at(60, 50)));
    assert(isSeen && !element.loaded, 'the poster is seen before the scene');
    await until(() => Number(bar.getAttribute('aria-valuenow')) > 0, 'a value in the progress bar');
    await open();
    await element.ready;
    await element.updateComplete;
    assert(isGreen((await screenOf(element)).at(60, 50)), 'the scene is seen');
    assertEqual(element.shadowRoot?.querySelector('[role=progressbar]'), null, 'progress bar');
  });

  it('shows no symbol of a broken image for a missing poster, and the next poster', async () => {
    const element = show({ src: COMPASS, poster: '/net/status/404', reveal: 'manual' });
    const image = (await rendered(element, 'img')) as HTMLImageElement;
    const isShown = (): boolean => getComputedStyle(image).visibility === 'visible';
    await until(() => image.complete && !isShown(), 'the missing poster to be hidden');
    element.poster = document.createElement('canvas').toDataURL();
    await until(() => isShown() && image.naturalWidth === 300, 'the next poster');
  });

  it('keeps properties that were set before the element was defined', async () => {
    // A second name for the same class is defined after its element was made.
    const early = document.createElement('early-splat') as GaussianSplatElement;
    early.src = COMPASS;
    early.cameraOrbit = '30deg 60deg 9m';
    early.cameraControls = true;
    early.style.cssText = 'width: 120px; height: 100px';
    document.body.append(early);
    const { GaussianSplatElement: Base } = await import('@gaussian-splat/element/element.js');
    customElements.define('early-splat', class extends Base {});
    await early.ready;
    assert(early.loaded && early.cameraControls, 'loaded with its properties');
    assert(Math.abs(early.getCameraOrbit().radius - 9) < 1e-9, String(early.getCameraOrbit()));
  });
});

describe('src', () => {
  it('the latest wins, in any order of responses', async () => {
    const element = show({ src: '/net/slow/compass.splat?ms=600' });
    const urls: string[] = [];
    element.addEventListener('load', (event) => urls.push(new URL(event.detail.url).pathname));
    await until(() => states(element).includes('loading'), 'the state loading');
    element.src = '/net/slow/compass.ply?ms=300';
    await element.updateComplete;
    element.src = `${FIXTURES}green.splat`;
    await element.ready;
    await delay(800);
    assertEqual(urls, [`${FIXTURES}green.splat`], 'loads');
    assertEqual(element.stats?.splats, 1, 'splats');
    assert(isGreen((await screenOf(element)).at(60, 50)), 'the last scene is seen');
  });

  it('is a local file as well as an address, and the same file is the same scene', async () => {
    const file = new File([await (await fetch(`${FIXTURES}green.splat`)).arrayBuffer()], 'a green#?%.splat');
    const element = show({});
    element.src = file;
    await element.ready;
    assertEqual(element.stats?.splats, 1, String(element.error?.message));
    let loads = 0;
    element.addEventListener('loadstart', () => loads++);
    element.src = COMPASS;
    element.src = file;
    await element.updateComplete;
    element.alt = 'Another';
    await element.updateComplete;
    assertEqual(loads, 0, 'loads');
    assertEqual(element.getAttribute('src'), null, 'attribute');
    element.src = new Blob(['no scene']);
    const { detail } = await nextEvent<CustomEvent<ElementError>>(element, 'error');
    assertEqual(detail.reason, 'decode/unknown-format', detail.message);
  });

  it('gives the memory of a file back once nothing refers to the file', async () => {
    const { revokeObjectURL } = URL;
    // Workers have such addresses, too.
    const revoked = new Set<string>();
    URL.revokeObjectURL = (url) => {
      revoked.add(url);
      revokeObjectURL(url);
    };
    try {
      const element = show({});
      const showFile = async (): Promise<string> => {
        element.src = new File([await (await fetch(COMPASS)).arrayBuffer()], 'compass.splat');
        const { detail } = await nextEvent<CustomEvent<{ url: string }>>(element, 'load');
        return detail.url.replace(/#.*/, '');
      };
      const url = await showFile();
      await executeServerCommand('heap-size');
      await delay(50);
      assertEqual(revoked.has(url), false, 'revoked while it is shown');
      element.src = COMPASS;
      await nextEvent(element, 'load');
      const end = performance.now() + 20_000;
      while (!revoked.has(url) && performance.now() < end) {
        await executeServerCommand('heap-size');
        await delay(50);
      }
      assertEqual(revoked.has(url), true, 'revoked afterwards');
    } finally {
      URL.revokeObjectURL = revokeObjectURL;
    }
  });

  it('a flip there and back loads nothing again', async () => {
    const element = await showLoaded();
    let loads = 0;
    element.addEventListener('progress', () => loads++);
    element.src = `${FIXTURES}green.splat`;
    element.src = COMPASS;
    await element.updateComplete;
    await delay(100);
    assertEqual(loads, 0, 'progress events');
    assert(element.loaded, 'still loaded');
  });

  it('keeps the old frame until the new scene is loaded', async () => {
    const element = await showLoaded(
      { src: `${FIXTURES}green.splat` },
      'width: 120px; height: 100px; --poster-transition: 0s',
    );
    const { src, open } = gated('compass.ply');
    element.src = src;
    await until(() => states(element).includes('loading'), 'the state loading');
    const isSeen = await comesToShow(element, (screen) => isGreen(screen.at(60, 50)));
    assert(isSeen && !element.loaded, 'the old scene is seen');
    await open();
    await element.ready;
    assertEqual(element.stats?.splats, 6, 'splats');
  });

  it('removed, clears the element', async () => {
    const element = await showLoaded(
      { src: `${FIXTURES}green.splat` },
      'width: 120px; height: 100px; background: white',
    );
    element.removeAttribute('src');
    await element.ready;
    await element.updateComplete;
    assertEqual([element.loaded, element.stats, states(element)], [false, null, []], 'after removal');
    assertEqual((await screenOf(element)).at(60, 50), [255, 255, 255], 'middle');
  });

  it('after an error, a good one recovers', async () => {
    const element = show({ src: '/net/status/404' });
    await nextEvent(element, 'error');
    element.src = COMPASS;
    await element.ready;
    await element.updateComplete;
    assert(element.loaded && element.error === null, 'loaded');
    assertEqual(element.shadowRoot?.querySelector('slot[name=error]'), null, 'error slot');
  });
});

/** glTF whose numbers lie in another file. */
const withoutBuffer = {
  asset: { version: '2.0' },
  nodes: [{ mesh: 0 }],
  meshes: [{ primitives: [{ attributes: { POSITION: 0 }, extensions: { KHR_gaussian_splatting: {} } }] }],
  accessors: [{ bufferView: 0, componentType: 5126, count: 1, type: 'VEC3' }],
  bufferViews: [{ buffer: 0, byteLength: 12 }],
  buffers: [{ uri: 'scene.bin', byteLength: 12 }],
};

describe('a bad source', () => {
  const cases: Readonly<Record<string, readonly [src: string, reason: string]>> = {
    'a missing file': ['/net/status/404', 'network/status'],
    'a server fault': ['/net/status/500', 'network/status'],
    'a web page instead of a scene': ['/net/html/scene.ply', 'decode/html'],
    'a git-LFS pointer': [`${FIXTURES}lfs-pointer.ply`, 'decode/lfs-pointer'],
    'a truncated file': [`${FIXTURES}truncated.ply`, 'decode/truncated'],
    'a broken connection': ['/net/cut/compass.ply', 'network/interrupted'],
    'no server': ['http://127.0.0.1:1/scene.ply', 'network/unreachable'],
    'no URL': ['http://', 'network/url'],
    'a part of a scene that has no place': [
      URL.createObjectURL(new Blob([JSON.stringify(withoutBuffer)])),
      'decode/unsupported',
    ],
    'a script': ['/tests/element/browser/fixtures/make.mjs', 'decode/unknown-format'],
  };
  for (const [name, [src, reason]] of Object.entries(cases)) {
    it(`${name}: ${reason}, and the page lives on`, async () => {
      const element = show({ src });
      const { detail } = await nextEvent<CustomEvent<ElementError>>(element, 'error');
      assertEqual([detail.reason, detail.code], [reason, reason.split('/')[0]], 'codes');
      assert(detail === element.error, 'the property holds the same object');
      assert(/expected .*, found .*\..*\[.*\]/.test(detail.message), detail.message);
      assert(!detail.message.includes('scene-worker'), detail.message);
      await element.ready;
      await element.updateComplete;
      assertEqual([element.loaded, states(element)], [false, ['error']], 'state');
      const text = element.shadowRoot?.querySelector('[part=error]')?.textContent ?? '';
      assert(text.includes(detail.message) && /3D scene could not be/.test(text), text);
      assertEqual(printed, [`<gaussian-splat>: ${detail.message}`], 'console');
      element.src = COMPASS;
      await element.ready;
      assert(element.loaded, 'a good scene loads afterwards');
    });
  }

  it('another origin without permission: network/unreachable; with it, the scene', async () => {
    const origin = await (await fetch('/net/other-origin')).text();
    const closed = show({ src: `${origin}/closed/compass.ply` });
    await nextEvent(closed, 'error');
    assertEqual(closed.error?.reason, 'network/unreachable');
    await showLoaded({ src: `${origin}/fixtures/compass.ply` });
  });

  it('a message that is taller than the element can be read from its beginning', async () => {
    const element = show({ src: '/a/missing.ply' }, 'width: 150px; height: 60px');
    await element.ready;
    const [message, text] = ['.message', '[part=error]'].map((part) => element.shadowRoot!.querySelector(part)!);
    assert(message.scrollHeight > message.clientHeight, 'it is taller');
    const top = text.getBoundingClientRect().top - message.getBoundingClientRect().top;
    assert(top >= 0, `it begins ${-top} pixels above what can be scrolled to`);
  });

  it('markup in a message stays text', async () => {
    const element = show({ src: '/net/status/404?<img src=x onerror=alert(1)>' });
    await nextEvent(element, 'error');
    await element.updateComplete;
    assertEqual(element.shadowRoot?.querySelectorAll('[part=error] img').length, 0, 'images in the message');
  });
});

describe('real scenes', () => {
  for (const name of ['scenes/plant.splat', 'scenes/angel.compressed.ply', 'formats/playbot3.niantic-v4.spz']) {
    it(name, async function () {
      const src = `/net/shared/${name}`;
      if (!(await fetch(src, { method: 'HEAD' })).ok) this.skip();
      const element = await showLoaded({ src });
      assert((element.stats?.splats ?? 0) > 10_000, JSON.stringify(element.stats));
      const { count } = (await screenOf(element)).middleOf(([r, g, b]) => r + g + b < 600) ?? { count: 0 };
      assert(count > 500, `${count} pixels are covered`);
    });
  }
});
