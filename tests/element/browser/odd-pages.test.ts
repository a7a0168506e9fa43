/**
 * Pages whose scripts have replaced browser APIs, and browsers that lack some of them: the scene is shown, or an error names the cause. Each page is a frame with the CDN build.
 * SECURITY.md: "The page keeps working".
 */
import { itInLab } from '../../support/extent-in-pages.js';
import { assert, assertEqual, COMPASS, nextEvent } from './support/harness.js';

interface Report {
  readonly loaded: boolean;
  readonly reason?: string;
  readonly message?: string;
  /** Pixels that are not transparent. */
  readonly drawn: number;
}

/** Shows a scene on a page on which a script has run before all others. */
async function reportOf(script: string): Promise<Report> {
  const frame = document.createElement('iframe');
  frame.style.cssText = 'width: 200px; height: 150px';
  frame.srcdoc = `<!doctype html><title>An odd page</title>
    <script>${script}</script>
    <gaussian-splat src="${COMPASS}" loading="eager" style="display: block; width: 120px; height: 100px"></gaussian-splat>
    <script type="module">
      await import('/packages/element/cdn/gaussian-splat.min.js');
      const element = document.querySelector('gaussian-splat');
      await Promise.race([element.ready, new Promise((resolve) => setTimeout(resolve, 60_000))]);
      let drawn = 0;
      if (element.loaded) {
        const image = await createImageBitmap(await (await fetch(element.toDataURL())).blob());
        const canvas = new OffscreenCanvas(image.width, image.height).getContext('2d');
        canvas.drawImage(image, 0, 0);
        const { data } = canvas.getImageData(0, 0, image.width, image.height);
        for (let at = 3; at < data.length; at += 4) if (data[at] > 0) drawn++;
      }
      const { reason, message } = element.error ?? {};
      parent.postMessage({ loaded: element.loaded, reason, message, drawn }, '*');
    </script>`;
  const answer = nextEvent<MessageEvent<Report>>(window, 'message', 90_000);
  document.body.append(frame);
  const { data } = await answer;
  frame.remove();
  return data;
}

async function isShown(script: string): Promise<void> {
  const { loaded, drawn, message } = await reportOf(script);
  assert(loaded, message ?? 'neither a scene nor an error');
  assert(drawn > 1_000, `${drawn} pixels are drawn`);
}

const CLOCK = (now: string): string => `
  performance.now = () => ${now};
  Date.now = () => ${now};
  const next = requestAnimationFrame;
  window.requestAnimationFrame = (callback) => next.call(window, () => callback(${now}));`;

/** `$A` of Prototype.js 1.7, which it puts in the place of Array.from. */
const PROTOTYPE_JS = `
  Array.from = (iterable) => {
    if (!iterable) return [];
    if ('toArray' in Object(iterable)) return iterable.toArray();
    let length = iterable.length || 0;
    const results = new Array(length);
    while (length--) results[length] = iterable[length];
    return results;
  };`;

const override = (object: string, name: string, value: string): string =>
  `Object.defineProperty(${object}, '${name}', { configurable: true, get: () => ${value} });`;

describe('odd pages', () => {
  it('a clock that stands still', () => isShown(CLOCK('5')));
  itInLab('a clock at zero', () => isShown(CLOCK('0')));
  it('Array.from of Prototype.js', async () => {
    const { loaded, reason } = await reportOf(PROTOTYPE_JS);
    assertEqual([loaded, reason], [false, 'unsupported/page']);
  });
  for (const ratio of ['NaN', '1e9', '0', '-1', '"two"'])
    itInLab(`a pixel ratio of ${ratio}`, () => isShown(override('window', 'devicePixelRatio', ratio)));
  for (const memory of ['NaN', '"much"', '-4', '0'])
    itInLab(`a deviceMemory of ${memory}`, () => isShown(override('Navigator.prototype', 'deviceMemory', memory)));
  itInLab('without ResizeObserver', () => isShown('delete window.ResizeObserver'));
  itInLab('without attachInternals', () => isShown('delete HTMLElement.prototype.attachInternals'));
  itInLab('with names on the prototype of all objects', async () => {
    const { loaded, reason } = await reportOf(`Object.prototype.signal = 'other'; Object.prototype.each = () => 0;`);
    assert(loaded || /^\w+\/[\w-]+$/.test(reason ?? ''), `shown, or a named error: ${reason}`);
  });
  itInLab('a WebGPU that throws when it is asked for', async () => {
    const { loaded, reason } = await reportOf(
      `Object.defineProperty(Navigator.prototype, 'gpu', { get() { throw new Error('blocked'); } });`,
    );
    if (!loaded) assertEqual(reason?.split('/')[0], 'unsupported');
  });
});
