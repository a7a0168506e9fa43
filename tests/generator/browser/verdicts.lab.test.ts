/** The corpus of both checkers (tests/fixtures/verdicts.json), opened by the page: the verdict is the same. */
import '@gaussian-splat/element';
import { GaussianSplatElement, type ElementError } from '@gaussian-splat/element';
import { assert, assertEqual, COMPASS, delay, show, until } from '../../element/browser/support/harness.js';
import { RUNTIME } from './support.js';

GaussianSplatElement.runtimeLocation = RUNTIME;

const ROOT = '/tests/fixtures/';
const verdicts = (await (await fetch(`${ROOT}verdicts.json`)).json()) as Record<string, string[]>;

const POST_PROCESSORS = ['s-temporal.onnx', 'gaussians-of-a-post-processor.onnx'];

/** Verdicts of the page with other codes than those of the checkers. */
const OTHERWISE: Readonly<Record<string, readonly string[]>> = {
  // The page counts the rows that cannot be drawn, and does not examine why.
  '21-huge-scales.onnx': ['contract/not-finite'],
  // A GPU reads the last row for an index beyond it, so that the run does not fail.
  '29-gather-out.onnx': [],
  // The page frames the bounds of its runs, and does not compare them with those of the contract.
  'periodic.onnx': [],
  // It is in order, but no generator draws the frame here.
  'gaussians-of-a-post-processor.onnx': ['contract/chain'],
};

// Verdicts are read from events. The page also warns of inferred contracts and of models that run on the CPU.
before(() => void Object.assign(console, { warn: () => undefined, error: () => undefined }));

describe('the page says the same as both checkers of', () => {
  for (const [name, codes] of Object.entries(verdicts)) {
    const expected = OTHERWISE[name] ?? codes;
    it(`${name}: ${expected.join(', ') || 'in order'}`, async () => {
      const found = new Set<string>();
      const file = `${ROOT}verdicts/${name}`;
      const given: Record<string, string> = POST_PROCESSORS.includes(name)
        ? { src: COMPASS, postprocess: file }
        : { src: file };
      const element = show(given, 'width: 64px; height: 64px');
      for (const type of ['error', 'generator-error'] as const)
        element.addEventListener(type, ({ detail }) => found.add((detail as ElementError).reason));
      // A model with image inputs waits for them.
      const hasOpened = (): boolean => element.loaded || element.inputs.length > 0;
      await until(() => hasOpened() || found.size > 0, 'a verdict', 60_000);
      // The first runs are judged after they are drawn.
      const isExpected = (): boolean => expected.some((code) => found.has(code));
      if (expected.length > 0) await until(isExpected, `${expected.join(' or ')}, not ${[...found].join()}`, 20_000);
      else {
        await delay(1500);
        assertEqual([...found], [], 'faults');
        assert(hasOpened(), 'not opened');
      }
      element.remove();
    });
  }
});
