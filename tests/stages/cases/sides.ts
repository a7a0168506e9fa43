import { packGaussians, SIDES } from '@gaussian-splat/renderer';
import { constants } from '@gaussian-splat/renderer/stages';
import { check, randomSource, type StageCase } from '../../support/gpu.js';
import { room, thinned } from '../../support/scenes.js';
import { cullOnGpu } from './projection.js';

const { CULL_GROUP, SIDE_WORDS } = constants;

/** Sets in which every splat shows from two sides, which are all that it shows from. */
function randomSets(count: number): { seenFrom: Uint32Array; sidesOf: (readonly number[])[] } {
  const random = randomSource(41);
  const row = CULL_GROUP * Math.ceil(count / CULL_GROUP);
  const seenFrom = new Uint32Array(SIDE_WORDS * row);
  const sidesOf = Array.from({ length: count }, (_, i) => {
    const sides = [0, 1].map(() => Math.floor(random() * SIDES.length));
    for (const side of sides) seenFrom[(side >>> 5) * row + i] |= 1 << (side & 31);
    return sides;
  });
  return { seenFrom, sidesOf };
}

export const sidesCases: readonly StageCase[] = (['parallel', 'serial'] as const).map((threads) => ({
  name: `cull, ${threads}: of what is visible, what shows from a side of the view stays; without sides all of it`,
  run: async (bench) => {
    const { cloud, cameras } = thinned(room(), 3000);
    const packed = packGaussians(cloud);
    const { seenFrom, sidesOf } = randomSets(packed.count);
    const all = await cullOnGpu(bench, packed, cameras[0], { threads });
    // Of one word, of the last bit of each, and of all words.
    for (const near of [[3], [31, 63, 95, 127], SIDES.map((_, side) => side).filter((side) => side % 3 === 0)]) {
      const sides = [0, 0, 0, 0];
      for (const side of near) sides[side >>> 5] = (sides[side >>> 5] | (1 << (side & 31))) >>> 0;
      const some = await cullOnGpu(bench, packed, cameras[0], { threads, sides, seenFrom });
      let kept = 0;
      sidesOf.forEach((own, i) => {
        const expected = all.visible[i] && own.some((side) => near.includes(side));
        check(some.visible[i] === expected, `splat ${i}, which shows from ${own.join()}, of sides ${near.join()}`);
        kept += +expected;
      });
      check(kept > 0 && kept < sidesOf.length, 'nothing or everything was kept: the case tests nothing');
    }
    const none = await cullOnGpu(bench, packed, cameras[0], { threads, seenFrom });
    all.visible.forEach((flag, i) => check(none.visible[i] === flag, `splat ${i}, without sides`));
  },
}));
