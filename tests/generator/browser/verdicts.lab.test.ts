/** The corpus of both checkers (tests/fixtures/verdicts.json), opened by the page: the verdict is the same. */
import '@gaussian-splat/element';
import { GaussianSplatElement, type ElementError } from '@gaussian-splat/element';
import { assert, delay, hurry, show } from '../../element/browser/support/harness.js';
import { RUNTIME } from './support.js';

GaussianSplatElement.runtimeLocation = RUNTIME;

const ROOT = '/tests/fixtures/';
const verdicts = (await (await fetch(`${ROOT}verdicts.json`)).json()) as Record<string, string[]>;

/** Verdicts of the page with other codes than those of the checkers. */
const OTHERWISE: Readonly<Record<string, readonly string[]>> = {
  // The page counts the rows that cannot be drawn, and does not examine why.
  '21-huge-scales.onnx': ['contract/not-finite'],
  // A GPU reads the last row for an index beyond it, so that the run does not fail.
  '29-gather-out.onnx': [],
};

beforeEach(() => hurry(3));

describe('the page says the same as both checkers of', () => {
  for (const [name, codes] of Object.entries(verdicts)) {
    it(`${name}: ${codes.join(', ') || 'in order'}`, async () => {
      const found = new Set<string>();
      const element = show({ src: `${ROOT}verdicts/${name}` }, 'width: 64px; height: 64px');
      for (const type of ['error', 'generator-error'] as const)
        element.addEventListener(type, ({ detail }) => found.add((detail as ElementError).reason));
      for (const end = performance.now() + 30_000; performance.now() < end && !element.loaded && found.size === 0;)
        await delay(100);
      // The first runs are judged after they are drawn.
      if (found.size === 0) await delay(1500);
      const expected = OTHERWISE[name] ?? codes;
      const reported = `expected ${expected.join(', ') || 'none'}, found ${[...found].join(', ') || 'none'}`;
      assert(
        expected.length === 0 ? found.size === 0 && element.loaded : expected.some((code) => found.has(code)),
        reported,
      );
      element.remove();
    });
  }
});
