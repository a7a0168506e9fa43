/**
 * The page for iframes: what its address may ask for.
 * SECURITY.md: "No text becomes markup".
 */
import { emulateMedia } from '@web/test-runner-commands';
import { violations } from './support/axe.js';
import { assert, assertEqual, COMPASS, nextEvent, until } from './support/harness.js';
import { comesToShow } from './support/screen.js';

interface Splat extends HTMLElement {
  readonly loaded: boolean;
}

async function open(query: string, allow = ''): Promise<Document> {
  const frame = document.createElement('iframe');
  frame.allow = allow;
  frame.src = `/packages/element/cdn/embed.html?${query}`;
  frame.style.cssText = 'width: 300px; height: 200px';
  const loaded = nextEvent(frame, 'load');
  document.body.append(frame);
  await loaded;
  const page = frame.contentDocument!;
  await until(() => page.querySelector('gaussian-splat, p') !== null, 'the page');
  return page;
}

describe('embed.html', () => {
  it('shows a scene of its own server with the attributes of its address', async () => {
    const query = {
      src: COMPASS,
      alt: '<b>A scene</b>',
      'camera-orbit': '30deg 75deg auto',
      vr: '',
      unit: '37cm',
      onload: 'x',
      chain: 'a.onnx',
    };
    const page = await open(String(new URLSearchParams(query)));
    const scene = page.querySelector<Splat>('gaussian-splat')!;
    const names = ['alt', 'camera-orbit', 'camera-controls', 'vr', 'unit', 'onload', 'chain'];
    assertEqual(
      names.map((name) => scene.getAttribute(name)),
      ['<b>A scene</b>', '30deg 75deg auto', '', '', '37cm', null, null],
      'attributes',
    );
    await until(() => scene.loaded, 'the scene', 30_000);
  });

  it('has a button for the full screen where its frame allows that, and nothing that axe finds', async () => {
    const query = String(new URLSearchParams({ src: COMPASS, alt: 'A compass' }));
    const page = await open(query, 'fullscreen');
    await until(() => page.querySelector<Splat>('gaussian-splat')!.loaded, 'the scene', 30_000);
    const button = page.querySelector('button')!;
    assertEqual([button.hidden, button.ariaLabel, page.title], [false, 'Full screen', 'A compass']);
    const { width, height } = button.getBoundingClientRect();
    assert(width >= 24 && height >= 24, `${width} x ${height}`);
    for (const look of [{ colorScheme: 'dark' }, { colorScheme: 'light', forcedColors: 'active' }] as const) {
      await emulateMedia(look);
      // The heading is that of the page around the frame.
      const options = { rules: { 'page-has-heading-one': { enabled: false } } };
      assertEqual(await violations(page, options), [], JSON.stringify(look));
    }
    await emulateMedia({ forcedColors: 'none', colorScheme: 'light' });
  });

  it('crops: the scene then has a tag of its own', async () => {
    const page = await open(
      String(new URLSearchParams({ src: COMPASS, up: '-y', crop: '0 -9 -9 9 9 9' })),
      "fullscreen 'none'",
    );
    const scene = page.querySelector<Splat & { getBoundingBox(): { min: { x: number } } }>('gaussian-splat')!;
    const child = scene.querySelector('splat-scene')!;
    assertEqual([scene.hasAttribute('src'), child.getAttribute('up')], [false, '-y'], 'attributes');
    assertEqual(page.querySelector('button')!.hidden, true, 'no button where its frame refuses the full screen');
    await until(() => scene.loaded, 'the scene', 30_000);
    const { x } = scene.getBoundingBox().min;
    assert(Math.abs(x) < 1e-6, `the least x is ${x}`);
    const refused = await open(String(new URLSearchParams({ src: 'data:,', crop: '0 0 0 1 1 1' })));
    assert(refused.querySelector('gaussian-splat') === null, 'a crop opens no other way to files');
  });

  it('refuses files of other servers and all other schemes, with a sentence', async () => {
    const refused = [
      'https://elsewhere.example/a.spz',
      '//elsewhere.example/a.spz',
      'javascript:alert(1)',
      'data:application/octet-stream,ply',
      `blob:${location.origin}/5a`,
      `${location.protocol}//me:secret@${location.host}/a.spz`,
      'file:///etc/passwd',
      'http://[',
    ];
    for (const src of refused) {
      const page = await open(String(new URLSearchParams({ src })));
      assert(page.querySelector('gaussian-splat') === null, src);
      assert(/^src: expected a file of http/.test(page.querySelector('p')!.textContent), src);
    }
    for (const name of ['poster', 'views', 'skybox-image', 'walk-map', 'ios-src', 'ios-splats']) {
      const page = await open(String(new URLSearchParams({ src: COMPASS, [name]: refused[0] })));
      assert(page.querySelector('p')!.textContent.startsWith(`${name}: expected`), name);
    }
    assert(/^src: expected the address/.test((await open('')).querySelector('p')!.textContent), 'no address');
  });

  it('asks no other server if its own redirects there', async () => {
    const other = await (await fetch('/net/other-origin')).text();
    const to = (address: string): string => `/net/redirect?to=${encodeURIComponent(address)}`;
    const shown = async (src: string): Promise<boolean> => {
      const page = await open(String(new URLSearchParams({ src, loading: 'eager' })));
      const scene = page.querySelector<Splat & { readonly error: Error | null }>('gaussian-splat')!;
      await until(() => scene.loaded || scene.error !== null, 'the end of the load', 30_000);
      return scene.loaded;
    };
    assertEqual(await shown(to(COMPASS)), true, 'a redirect within the server');
    assertEqual(await shown(to(`${other}/fixtures/compass.splat?embedded`)), false, 'one to another server');
    const asked = (await (await fetch(`${other}/asked`)).json()) as string[];
    assertEqual(
      asked.filter((url) => url.includes('embedded')),
      [],
      'requests to the other server',
    );
  });

  it('says what its server must send where a sandbox takes its origin away', async () => {
    const frame = document.createElement('iframe');
    frame.setAttribute('sandbox', 'allow-scripts');
    frame.src = `/packages/element/cdn/embed.html?src=${COMPASS}`;
    frame.style.cssText = 'width: 300px; height: 200px; border: 0';
    document.body.append(frame);
    // Scripts cannot read it, so the test reads the screen.
    assert(
      await comesToShow(frame, (screen) => screen.middleOf(([red]) => red < 100) !== null),
      'the frame stays blank',
    );
  });

  it('keeps its size where WordPress filters the code of the playground as that of another site', async () => {
    const module = '/demo/playground/html.js';
    const { frameOf } = (await import(module)) as { frameOf(cdn: string, attributes: readonly string[][]): string };
    const code = frameOf('/packages/element/cdn/', [
      ['src', COMPASS],
      ['alt', 'A compass'],
    ]);
    const page = document.createElement('template');
    page.innerHTML = code;
    const frame = page.content.querySelector('iframe')!;
    // As wp_filter_oembed_result() does.
    const kept = 'src width height frameborder marginwidth marginheight scrolling title'.split(' ');
    for (const { name } of [...frame.attributes]) if (!kept.includes(name)) frame.removeAttribute(name);
    frame.setAttribute('sandbox', 'allow-scripts');
    frame.setAttribute('security', 'restricted');
    document.body.append(frame);
    assertEqual([frame.clientWidth, frame.clientHeight, frame.title], [800, 600, 'A compass']);
    const whole = document.createElement('div');
    whole.style.width = '300px';
    whole.innerHTML = code;
    document.body.append(whole);
    const { clientWidth, clientHeight } = whole.querySelector('iframe')!;
    assertEqual([clientWidth, clientHeight], [300, 225], 'with its style');
  });
});
