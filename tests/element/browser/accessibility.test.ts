/** axe-core on the element in all its states, and on every page of the demo as it is built. */
import '@gaussian-splat/element';
import { assert, assertEqual, COMPASS, delay, nextEvent, show, showLoaded, until } from './support/harness.js';

interface AxeResults {
  readonly violations: readonly {
    readonly id: string;
    readonly help: string;
    readonly nodes: readonly { readonly html: string }[];
  }[];
  readonly passes: readonly { readonly id: string }[];
}
interface Axe {
  run(context: Document, options?: object): Promise<AxeResults>;
}

async function axeIn(page: Document): Promise<Axe> {
  const scope = page.defaultView as (Window & { axe?: Axe }) | null;
  assert(scope, 'a window');
  if (scope.axe) return scope.axe;
  const script = page.createElement('script');
  script.src = '/node_modules/axe-core/axe.min.js';
  const loaded = nextEvent(script, 'load');
  page.head.append(script);
  await loaded;
  assert(scope.axe, 'axe');
  return scope.axe;
}

async function violations(page: Document, options?: object): Promise<string[]> {
  const { violations, passes } = await (await axeIn(page)).run(page, options);
  assert(passes.length > 0, 'axe has looked at something');
  return violations.map(
    ({ id, help, nodes }) => `${id}: ${help}: ${nodes.map(({ html }) => html.slice(0, 160)).join(' | ')}`,
  );
}

/** Only the element: the test's own page has no title, no landmarks and no heading. */
const ELEMENT_ONLY = {
  rules: Object.fromEntries(
    ['document-title', 'html-has-lang', 'landmark-one-main', 'page-has-heading-one', 'region'].map((id) => [
      id,
      { enabled: false },
    ]),
  ),
};

const hotspot = (name: string): HTMLButtonElement => {
  const button = document.createElement('button');
  button.slot = `hotspot-${name}`;
  button.dataset.position = '0m 0m 1m';
  button.textContent = name;
  return button;
};

describe('axe finds nothing in the element', () => {
  it('as a picture, as an application with prompt and hotspots, as decoration', async () => {
    await showLoaded({ alt: 'A compass' });
    const application = await showLoaded({
      'camera-controls': '',
      'interaction-prompt-threshold': '0',
      alt: 'Another',
    });
    application.append(hotspot('north'), hotspot('south'));
    await showLoaded({ alt: '' });
    await until(() => application.shadowRoot?.querySelector('[part=prompt]') !== null, 'the prompt');
    assertEqual(await violations(document, ELEMENT_ONLY), []);
  });

  it('while it waits behind its poster, while it loads, and after it has failed', async () => {
    show({ src: COMPASS, reveal: 'manual', poster: '/demo/dist/scenes/skull-poster.webp', alt: 'Behind a poster' });
    const loading = show({ src: '/net/slow/compass.ply?ms=20000', alt: 'Loading' });
    const failed = show({ src: '/net/status/404', alt: 'Failed' }, 'width: 400px; height: 200px');
    await nextEvent(failed, 'error');
    await until(() => loading.shadowRoot?.querySelector('[role=progressbar]') !== null, 'the progress bar');
    assertEqual(await violations(document, ELEMENT_ONLY), []);
  });

  it('and would find something', async () => {
    const input = document.createElement('input');
    document.body.append(input);
    assert(
      (await violations(document, ELEMENT_ONLY)).some((text) => text.startsWith('label')),
      'an input without a label',
    );
  });
});

const PAGES = [
  'index.html',
  'check/index.html',
  'bench/index.html',
  'bench/frontier.html',
  'react/index.html',
  'vue/index.html',
];

describe('axe finds nothing on the demo', () => {
  it('knows all of its pages', async () => {
    // The pages that the benchmark frames have no content of their own.
    const found: string[] = [];
    for (const name of PAGES) if ((await fetch(`/demo/dist/${name}`)).ok) found.push(name);
    assertEqual(found, PAGES);
  });

  for (const name of PAGES) {
    for (const width of [390, 1280]) {
      it(`${name} at ${width} pixels`, async () => {
        const frame = document.createElement('iframe');
        frame.style.cssText = `width: ${width}px; height: 800px; border: 0`;
        // Benchmarks wait to be started.
        frame.src = `/demo/dist/${name}`;
        const loaded = nextEvent(frame, 'load');
        document.body.append(frame);
        await loaded;
        await delay(600);
        const page = frame.contentDocument;
        assert(page, 'a page');
        assertEqual(await violations(page), []);
      });
    }
  }
});
