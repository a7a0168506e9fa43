import { GaussianSplatError, toDegree, type GaussianCloud } from '@gaussian-splat/core';
import { mortonOrder } from '../pack/morton.js';
import { usableIndices } from '../pack/pack.js';
import type { LevelPage, LevelScene } from './level-pages.js';
import { SLOT_CHUNKS, pageLayout } from './manifest.js';
import { joinSlots, packRun } from './pack-run.js';
import { emptyList, putBelow, type PageList } from './page-list.js';
import type { PageSource, StreamedScene } from './page-source.js';
import { slotBySlot, type SlotWords } from './slot-words.js';
import { chunksOf } from '../levels/splat-level.js';

/**
 * Returns the words of a page: chunks in the layout of docs/lod-format.md, slot by slot.
 * @param cloud Splats of the page.
 * @throws GaussianSplatError `argument/cloud` for a cloud without usable splats, or with more splats than the page has.
 */
export function packLevelPage(
  cloud: GaussianCloud,
  { count, sphere, error }: LevelPage,
  scene: StreamedScene,
): Uint32Array<ArrayBuffer> {
  const placed = placedIn(cloud, scene);
  const usable = usableIndices(placed);
  if (usable.length === 0 || usable.length > count) {
    throw new GaussianSplatError('argument/cloud', {
      where: 'page of a scene with levels of its own',
      expected: `1 to ${count} splats that can be drawn`,
      found: String(usable.length),
      remedy: 'pass the splats of the run that the index names',
    });
  }
  const run = packRun(placed, mortonOrder(placed.positions, usable), scene);
  return joinSlots([{ ...run, sphere, error }], scene);
}

/** Returns the cloud relative to the origin of the scene, with spherical harmonics of the scene's degree. */
export function placedIn(cloud: GaussianCloud, { origin, shDegree }: StreamedScene): GaussianCloud {
  const shift = cloud.origin.map((x, axis) => x - origin[axis]);
  const positions = shift.every((x) => x === 0) ? cloud.positions : cloud.positions.slice();
  if (positions !== cloud.positions) {
    for (let k = 0; k < positions.length; k += 3) {
      positions[k] += shift[0];
      positions[k + 1] += shift[1];
      positions[k + 2] += shift[2];
    }
  }
  return { ...cloud, origin, positions, sh: toDegree(shDegree, cloud).sh, shDegree };
}

function listLevels({ first, firstChunks, pages, scene }: LevelScene): PageList {
  const total = first.length / pageLayout(scene, 1).total;
  const chunks = [total, ...pages.map(({ count }) => chunksOf(count))];
  const list = emptyList(Uint32Array.from(chunks, (count) => Math.ceil(count / SLOT_CHUNKS)));
  list.chunks.set(chunks);
  list.upper.set(chunks);
  let [boxBefore, start] = [0, 0];
  pages.forEach(({ box, level }, p) => {
    while (boxBefore < box) start += firstChunks[boxBefore++];
    if (level === 1) putBelow(list, p + 1, 0, start, firstChunks[box]);
    else putBelow(list, p + 1, p, 0, list.chunks[p]);
  });
  return list;
}

/**
 * Returns the page source of a scene whose file has its own levels.
 * @param levels Levels of the scene. The first page keeps their buffer `first`.
 * @param fetchLevel Fetches a page and resolves to its words: see {@link packLevelPage}, preferably in a worker.
 */
export function levelSource(
  levels: LevelScene,
  fetchLevel: (page: LevelPage, signal: AbortSignal) => Promise<Uint32Array<ArrayBuffer>>,
): PageSource {
  const { scene, pages } = levels;
  const list = listLevels(levels);
  const chunk = pageLayout(scene, 1).total;
  const fetch = async (page: number, signal: AbortSignal): Promise<SlotWords[]> => {
    if (page === 0) return slotBySlot(levels.first, scene);
    const words = await fetchLevel(pages[page - 1], signal);
    const chunks = words.length / chunk;
    if (Number.isInteger(chunks) && chunks >= 1 && chunks <= list.chunks[page]) return slotBySlot(words, scene);
    throw new GaussianSplatError('decode/truncated', {
      where: `level ${pages[page - 1].level} of box ${pages[page - 1].box}`,
      expected: `1 to ${list.chunks[page]} chunks of ${4 * chunk} bytes`,
      found: `${words.byteLength} bytes`,
      remedy: 'pass the result of packLevelPage for the run',
    });
  };
  return { scene, list, fetch };
}
