/** Boxes with levels of detail of their own, as a streamed SOG scene has them. */
import { keepUsable, type GaussianCloud } from '@gaussian-splat/core';
import { layoutLevels, type LevelScene } from '@gaussian-splat/renderer/tools';
import { randomSource } from '../gpu.js';
import { pick } from '../lod-folder.js';
import { pebbles } from './pebbles.js';

/** Boxes in a row, each a heap of splats at three or four levels, with splats in all of them that cannot be drawn. */
export function heaps(count: number): { levels: LevelScene; clouds: GaussianCloud[][] } {
  const random = randomSource(3);
  const clouds = Array.from({ length: count }, (_, box) => {
    const cloud = pebbles(8_000 + 900 * box, box + 1);
    const finest = { ...cloud, positions: cloud.positions.map((x, i) => (i % 3 === 0 ? x / 4 + 5 * box : x / 4)) };
    for (let i = 0; i < finest.count; i++) if (random() < 0.1) finest.opacities[i] = NaN;
    const every = (step: number): GaussianCloud =>
      pick(
        finest,
        Array.from({ length: Math.ceil(finest.count / step) }, (_, k) => k * step),
        Math.sqrt(step) / 6,
      );
    return box % 2 === 0 ? [every(40), every(9), every(2), every(1)] : [every(30), every(5), every(1)];
  });
  // The first box draws nothing at its coarsest level.
  clouds[0][0].opacities.fill(NaN);
  const sky = pick(pebbles(700, 99), [...Array(700).keys()], 3);
  const parts = [...clouds.map(([coarsest]) => coarsest), sky];
  const joined = (key: 'positions' | 'scales' | 'rotations' | 'opacities' | 'sh'): Float32Array =>
    Float32Array.from(parts.flatMap((part) => [...part[key]]));
  let first = 0;
  const levelRuns = parts.map((part, node) => {
    const run = { first, count: part.count, node, level: 0 };
    first += part.count;
    return run;
  });
  const coarsest: GaussianCloud = {
    ...{ ...sky, count: first, levelRuns, positions: joined('positions'), scales: joined('scales') },
    ...{ rotations: joined('rotations'), opacities: joined('opacities'), sh: joined('sh') },
  };
  const boxes = clouds.map((own, box) => ({
    ...{ min: [5 * box - 1.7, -0.5, -1.7], max: [5 * box + 1.7, 0.5, 1.7] },
    counts: own.map((level) => level.count),
  }));
  return { levels: layoutLevels(keepUsable(coarsest), boxes), clouds };
}
