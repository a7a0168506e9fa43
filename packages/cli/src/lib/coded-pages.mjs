/** How coarse the pages of a streamed scene may be: measured in pictures of them, attribute by attribute. */
import { boundsOf } from '@gaussian-splat/core';
import { allocateSteps, fitSteps, GpuEvaluator, viewsAround, viewsFromEverywhere } from '@gaussian-splat/economise';
import { decodePage } from '@gaussian-splat/renderer';
import { cloudOfChunks, codingOf, manifestOf, PageEncoder, USUAL_STEPS } from '@gaussian-splat/economise/pages';
import { deflateQuickly } from './encoders.mjs';

/** Numbers of a splat that each step is that of; of harmonics half, for many are 0 anyway. */
const numbersOf = (degree) => ({
  ...{ place: 3, size: 3, direction: 3, opacity: 1, color: 1, chroma: 2 },
  ...(degree > 0 && { harmonics: 1.5 * ((degree + 1) ** 2 - 1) }),
});

const decibels = (error) => -10 * Math.log10(error);
const meanOf = (errors) => errors.reduce((sum, error) => sum + error, 0) / errors.length;

/** Pictures of what pages hold, against those of the scene. */
class PageJudge {
  #tree;
  #pages;
  #evaluator;
  #seen;

  constructor(tree, pages, evaluator, seen) {
    this.#tree = tree;
    this.#seen = seen;
    this.#evaluator = evaluator;
    this.#pages = pages.filter(({ holds }) => holds.some(([level]) => level === 0));
  }

  /** Mean squared errors of each view, peak 1. */
  async errors(steps, views) {
    const coding = codingOf(steps);
    const encoder = new PageEncoder(this.#tree, coding, { deflate: deflateQuickly, seen: this.#seen });
    const scene = manifestOf(this.#tree, [], String, coding);
    const parts = [];
    for (const page of this.#pages) {
      const { chunks, upper, holds } = page;
      const file = { chunks, upper, shDegree: scene.shDegree, coding };
      const words = new Uint32Array(await decodePage('page', encoder.encode(page), file));
      const leaves = holds.flatMap(([level], chunk) => (level === 0 ? [chunk] : []));
      parts.push({ words, of: chunks, chunks: leaves });
    }
    return this.#evaluator.compare(cloudOfChunks(scene, parts), views);
  }
}

/**
 * Steps with which the finest pages of a scene are so near to it in held-out views, and where errors of all attributes cost the same: an attribute whose rounding
 * shows little has larger ones.
 * @param scored views that say how the splats are seen, which harmonics are rounded by
 * @param onStep hears what was found
 * @returns the steps, how the splats are seen, and dB over covered pixels of all held-out views together, and of the worst
 */
export async function findSteps({ tree, pages, cloud, device, minDecibels, scored, onStep }) {
  const around = (count, seed) => viewsAround(boundsOf(cloud), count, { seed });
  const { shDegree } = tree.levels[0];
  const everywhere = viewsFromEverywhere(boundsOf(cloud), shDegree > 0 ? scored : 1);
  const views = { scored: everywhere, searched: around(4, 1), heldOut: around(12, 2) };
  const evaluator = await GpuEvaluator.create(device, cloud, views, {
    onScored: (done, all) => onStep(`${done} of ${all} views show how splats are seen`),
  });
  let seen;
  if (shDegree > 0) {
    await evaluator.rank();
    seen = await evaluator.seen();
  }
  const judge = new PageJudge(tree, pages, evaluator, seen);
  const target = 10 ** (-minDecibels / 10);
  const measure = async (steps) => meanOf(await judge.errors(steps, 'searched'));
  const numbers = numbersOf(shDegree);
  const steps = await allocateSteps({ usual: USUAL_STEPS, numbers, measure, target });
  const best = await fitSteps({
    steps,
    target,
    measure: async (scaled) => {
      const errors = await judge.errors(scaled, 'heldOut');
      const error = meanOf(errors);
      onStep(`${decibels(error).toFixed(2)} dB in held-out views`);
      return { error, decibels: decibels(error), worstDecibels: decibels(Math.max(...errors)) };
    },
  });
  evaluator.destroy();
  return { ...best, seen };
}
