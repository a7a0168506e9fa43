/** The levels of frames in motion against their measurements: docs/frontier/frontier-*.json, written by `npm run lab -- frontier`. */
import assert from 'node:assert/strict';
import { readdirSync, readFileSync } from 'node:fs';
import { test } from 'node:test';
import { QUALITY_LEVELS } from '../support/element/quality.js';
import { QUALITIES } from '@gaussian-splat/renderer';

interface Line {
  readonly configuration: { readonly name: string; readonly options: { quality?: string; resolutionScale?: number } };
  readonly quality: { readonly psnr: number };
  readonly ratio: { readonly burst: { readonly p50: number } };
}

const folder = new URL('../../docs/frontier/', import.meta.url);
const files = readdirSync(folder).filter((name) => /^frontier-.*\.json$/.test(name));
/** Fraction of the time that bursts save. */
const NOISE = 1.03;
/** Smaller images than that win nothing of a small scene on a wide GPU: half of its time does not depend on the pixels (docs/benchmark.md). */
const SMALLEST_THAT_WINS = 0.5;

/** Measurements in which fewer pixels do not take less time, because the frame does not depend on its pixels. */
const KNOWN: Readonly<Record<string, string>> = {
  'frontier-nvidia-h200.json': 'a frame takes 0.37 ms, and enlarging 0.71 of the pixels across costs what they save',
};

test('there are figures', () => assert.ok(files.length > 0));

test('the levels are the quality balanced, whole and of fewer pixels', () => {
  for (const { settings, scale } of QUALITY_LEVELS.slice(1)) {
    const { detail, resolutionScale = 1, ...others } = settings!;
    assert.equal(resolutionScale, scale);
    assert.ok(detail! <= 1);
    for (const [name, value] of Object.entries(others))
      assert.equal(value, QUALITIES.balanced[name as keyof typeof others], name);
  }
});

for (const file of files) {
  const { results } = JSON.parse(readFileSync(new URL(file, folder), 'utf8')) as { results: readonly Line[] };
  const lineOf = (name: string) => {
    const line = results.find(({ configuration }) => configuration.name === (name === 'whole' ? 'default' : name));
    assert.ok(line, `${name} was measured`);
    return { psnr: line.quality.psnr, ratio: line.ratio.burst.p50 };
  };

  test(`${file}: each level down loses more and takes less`, { skip: KNOWN[file] }, () => {
    for (let k = 1; k < QUALITY_LEVELS.length; k++) {
      const [above, below] = [lineOf(QUALITY_LEVELS[k - 1].name), lineOf(QUALITY_LEVELS[k].name)];
      assert.ok(below.psnr < above.psnr, `PSNR of ${QUALITY_LEVELS[k].name}`);
      const wins = QUALITY_LEVELS[k].scale >= SMALLEST_THAT_WINS ? 1 / NOISE : NOISE;
      assert.ok(below.ratio < above.ratio * wins, `${QUALITY_LEVELS[k].name}: ${below.ratio} after ${above.ratio}`);
    }
  });

  test(`${file}: the settings of balanced lose far less than fewer pixels`, () => {
    // Since images are enlarged by Catmull-Rom, 0.71 has 3 dB more than before.
    assert.ok(lineOf('balanced').psnr > lineOf('balanced at 0.71').psnr + 5);
  });
}
