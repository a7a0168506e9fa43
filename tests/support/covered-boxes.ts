/** Whether the levels of a streamed scene whose file has levels of its own cover each of its boxes exactly once. */
import assert from 'node:assert/strict';
import type { PageSource, StreamedGaussians } from '@gaussian-splat/renderer';
import type { LevelScene } from '@gaussian-splat/renderer/tools';
import { DETAIL_NUMBERS, DETAIL_PLACES, SLOT_CHUNKS } from '@gaussian-splat/renderer/stages';
import { shareDrawn, type DetailView } from './detail-twin.js';
import { readRows } from './read-rows.js';

/** Asserts that the weights of each box's levels add up to 1 during any fade. @returns levels that are drawn, and pages that are fully resident */
export async function checkBoxes(
  { firstChunks, pages }: Pick<LevelScene, 'firstChunks' | 'pages'>,
  source: PageSource,
  scene: StreamedGaussians,
  { camera, allowed }: Pick<DetailView, 'camera' | 'allowed'>,
): Promise<{ drawn: Set<number>; whole: Set<number> }> {
  const rows = await readRows(scene);
  const drawn = new Set<number>();
  const whole = new Set<number>();
  const slots = scene.pagesInSlots;
  const slotsOf = (page: number): number[] => slots.flatMap((other, slot) => (other === page ? [slot] : []));
  const isEmpty = (slot: number, chunk: number): boolean =>
    rows[slot][DETAIL_NUMBERS * chunk + DETAIL_PLACES.parentError] === 0;
  slots.forEach(
    (page, slot) =>
      page ??
      assert.ok(
        rows[slot].every((x) => x === 0),
        `slot ${slot} is empty`,
      ),
  );
  const chunksOf = (page: number): [slot: number, chunk: number][] =>
    slotsOf(page).flatMap((slot) =>
      [...Array(SLOT_CHUNKS).keys()].flatMap((chunk): [number, number][] =>
        isEmpty(slot, chunk) ? [] : [[slot, chunk]],
      ),
    );
  const ownChunks = chunksOf(0);
  assert.equal(ownChunks.length, source.list.chunks[0]);
  for (const fade of [0, 0.5]) {
    const view = { camera, allowed, fade };
    const shareOf = (chunks: readonly [number, number][]): number => {
      const shares = new Set(chunks.map(([slot, chunk]) => shareDrawn(rows[slot], chunk, view)));
      assert.ok(shares.size <= 1, `the chunks of a run go together: ${[...shares].join()}`);
      return [...shares][0] ?? 0;
    };
    let start = 0;
    firstChunks.forEach((count, box) => {
      let sum = shareOf(ownChunks.slice(start, start + count));
      start += count;
      pages.forEach((page, p) => {
        if (page.box !== box || slotsOf(p + 1).length === 0) return;
        assert.equal(slotsOf(p + 1).length, source.list.slots[p + 1]);
        const share = shareOf(chunksOf(p + 1));
        if (chunksOf(p + 1).length > 0) whole.add(p + 1);
        if (share > 0) drawn.add(p + 1);
        sum += share;
      });
      assert.ok(Math.abs(sum - 1) < 1e-4, `box ${box}: covered ${sum} times with a fade of ${fade}`);
    });
    const around = ownChunks.slice(start);
    if (around.length > 0) assert.equal(shareOf(around), 1, 'what is in no box is always drawn');
  }
  return { drawn, whole };
}
