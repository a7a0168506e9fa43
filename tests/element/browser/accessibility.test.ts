/** axe-core on the element in all its states. The pages of the site: tests/site. */
import '@gaussian-splat/element';
import { emulateMedia } from '@web/test-runner-commands';
import { ELEMENT_ONLY, violations } from './support/axe.js';
import { assert, assertEqual, COMPASS, nextEvent, show, showLoaded, until } from './support/harness.js';

const hotspot = (name: string): HTMLButtonElement => {
  const button = document.createElement('button');
  button.slot = `hotspot-${name}`;
  button.dataset.position = '0m 0m 1m';
  button.textContent = name;
  return button;
};

describe('axe finds nothing in the element', () => {
  it('as an image, as an application with prompt and hotspots, as decoration', async () => {
    await showLoaded({ alt: 'A compass' });
    const application = await showLoaded({
      'camera-controls': '',
      'interaction-prompt-threshold': '0',
      alt: 'Another',
    });
    application.append(hotspot('north'), hotspot('south'));
    await showLoaded({ alt: '' });
    const turning = await showLoaded({ alt: 'On a turntable', 'auto-rotate': '', 'auto-rotate-delay': '60000' });
    await until(
      () => turning.shadowRoot?.querySelector('[part=pause-button]') instanceof Element,
      'a button that stops it',
    );
    await until(() => application.shadowRoot?.querySelector('[part=interaction-prompt]') !== null, 'the prompt');
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

describe('screen readers', () => {
  it('are notified of an error in an existing live region, in the words of the page if it has some', async () => {
    const element = show({ src: '/net/slow/compass.ply?ms=400' });
    const own = show({ src: '/net/status/404' });
    own.innerHTML = '<p slot="error">Leider nein.</p>';
    await element.updateComplete;
    const regions = element.shadowRoot?.querySelectorAll('[role=status]');
    assertEqual([regions?.length, regions?.[0].textContent], [1, ''], 'regions and text at first');
    element.src = '/net/status/404';
    await nextEvent(element, 'error');
    await Promise.all([element.updateComplete, own.ready]);
    assertEqual(element.shadowRoot?.querySelectorAll('[role=status]').length, 1, 'regions after the error');
    assert(/\w+ \w+/.test(regions?.[0].textContent ?? ''), 'a sentence in the first one');
    await own.updateComplete;
    assertEqual(own.shadowRoot?.querySelector('[role=status]')?.textContent, 'Leider nein.', 'the words of the page');
  });
});

describe('a page that runs from right to left', () => {
  it('has English sentences of the element from left to right, and a progress bar that fills from the right', async () => {
    const failed = show({ src: '/net/status/404' }, 'width: 400px; height: 200px');
    const loading = show({ src: '/net/slow/compass.ply?ms=20000' });
    document.body.dir = 'rtl';
    try {
      await nextEvent(failed, 'error');
      await failed.updateComplete;
      const paragraph = failed.shadowRoot!.querySelector('[part=error] p')!;
      const sentence = document.createTreeWalker(paragraph, NodeFilter.SHOW_TEXT).nextNode()!;
      const range = document.createRange();
      const left = (at: number): number => {
        range.setStart(sentence, at);
        range.setEnd(sentence, at + 1);
        return range.getBoundingClientRect().left;
      };
      const last = sentence.nodeValue!.trimEnd().length - 1;
      assert(left(last) > left(last - 1), 'the full stop is at the end');
      await until(() => loading.progress > 0.2 && loading.progress < 0.9, 'a part');
      const [bar, track] = ['bar', 'track'].map((name) =>
        loading.shadowRoot!.querySelector(`[part=progress-${name}]`)!.getBoundingClientRect(),
      );
      assert(bar.width < track.width && bar.right === track.right, `${bar.left} to ${bar.right} of ${track.right}`);
    } finally {
      document.body.dir = '';
    }
  });
});

describe('forced colors', () => {
  it('leave the progress bar visible', async () => {
    const element = show({ src: '/net/slow/compass.ply?ms=20000' });
    const part = (name: string): HTMLElement | null | undefined =>
      element.shadowRoot?.querySelector<HTMLElement>(`[part=progress-${name}]`);
    await until(() => !!part('bar'), 'the progress bar');
    await emulateMedia({ forcedColors: 'active' });
    const colors = ['bar', 'track'].map((name) => getComputedStyle(part(name) as HTMLElement).backgroundColor);
    await emulateMedia({ forcedColors: 'none' });
    assert(colors[0] !== colors[1], `bar and track are ${colors.join(' and ')}`);
  });
});
