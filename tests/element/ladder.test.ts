/** The ladder of pictures in motion against what was measured of it (docs/frontier/ladder-*.json, written by `npm run lab:frontier:ladder`). */
import assert from 'node:assert/strict';
import { readdirSync, readFileSync } from 'node:fs';
import { test } from 'node:test';
import { LADDER } from '../../packages/element/src/pace/ladder.js';
import { inPixels } from '../../packages/element/src/pace/time-model.js';

interface Figures {
  readonly rungs: readonly { name: string; levers?: object; ms: number; psnr: number | null }[];
}

const folder = new URL('../../docs/frontier/', import.meta.url);
const files = readdirSync(folder).filter((name) => /^ladder-.*\.json$/.test(name));
/** The first rung, which the others are held against, has no error to itself; to the float64 picture it has this, in dB. */
const TRUE_DB = 65;
/** Times of a processor that others use, too, are good for so much. */
const NOISE = 1.25;
/** An error of less than a third. */
const FAR_LESS_DB = 10;

/** The figures' scene has neither levels of detail nor visible sets: with or without those levers it is the same picture. */
const present = (levers: object = {}): object =>
  Object.fromEntries(Object.entries(levers).filter(([lever]) => !['detail', 'visibleSets'].includes(lever)));

test('there are figures', () => assert.ok(files.length > 0));

for (const file of files) {
  const { rungs } = JSON.parse(readFileSync(new URL(file, folder), 'utf8')) as Figures;
  const figure = (name: string): { ms: number; psnr: number } => {
    const { ms, psnr } = rungs.find((rung) => rung.name === name)!;
    return { ms, psnr: psnr ?? TRUE_DB };
  };
  const ladder = LADDER.map(({ name }) => figure(name));

  test(`${file}: the figures are of these rungs`, () => {
    for (const { name, levers } of LADDER) {
      const measured = rungs.find((rung) => rung.name === name);
      assert.ok(measured, `${name} was measured`);
      assert.deepEqual(present(measured.levers), present(levers), `levers of ${name}: measure anew`);
    }
  });

  test(`${file}: each rung down loses more and takes no more time`, () => {
    for (let k = 1; k < ladder.length; k++) {
      assert.ok(ladder[k].psnr < ladder[k - 1].psnr, `dB of ${LADDER[k].name}`);
      assert.ok(ladder[k].ms <= NOISE * ladder[k - 1].ms, `ms of ${LADDER[k].name}`);
    }
  });

  test(`${file}: the levers that come first lose far less than fewer pixels, which lose little more with them`, () => {
    // By time alone they are too near to each other to be told apart where quads are drawn on a busy processor.
    assert.ok(figure('fast').psnr > figure('whole at 0.84').psnr + FAR_LESS_DB, `${figure('fast').psnr} dB`);
    // With them, fewer pixels lose little more than alone, and take no more.
    assert.ok(figure('fast at 0.5').ms <= NOISE * figure('whole at 0.5').ms, 'half of each side');
    assert.ok(figure('whole at 0.5').psnr - figure('fast at 0.5').psnr < 3, 'dB of half of each side');
  });

  test(`${file}: no climb costs more than its pixels say`, () => {
    for (let k = 1; k < ladder.length; k++) {
      const [above, below] = [k - 1, k].map((level) => inPixels(LADDER[level], level));
      const [said, found] = [above / below, ladder[k - 1].ms / ladder[k].ms];
      assert.ok(found <= NOISE * said, `${LADDER[k].name} to ${LADDER[k - 1].name}: ${found} times, said ${said}`);
    }
  });
}
