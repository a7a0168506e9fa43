/** How coarse the pages of a streamed scene may be: measured in pictures of them, attribute by attribute. */
import { boundsOf } from '@gaussian-splat/core';
import { allocateSteps, GpuEvaluator, scaledSteps, viewsAround, viewsFromEverywhere } from '@gaussian-splat/economise';
import { cloudOfChunks, codingOf, decodePage, manifestOf, PageEncoder, USUAL_STEPS } from '@gaussian-splat/renderer';
import { deflateQuickly } from './encoders.mjs';

/** Numbers of a splat that each step is that of; of harmonics half, for many are 0 anyway. */
const numbersOf = (degree) => ({
  ...{ place: 3, size: 3, direction: 3, opacity: 1, color: 1, chroma: 2 },
  ...(degree > 0 && { harmonics: 1.5 * ((degree + 1) ** 2 - 1) }),
});

/** How near to the figure a search ends, and what it aims at, as parts of the error. */
const [NEAR_ENOUGH, AIMED] = [0.97, 0.985];
const MOST_TRIES = 6;
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

/** What all steps are multiplied by next: errors go with their square, until tries above and below the figure tell more. */
function nextScale(tried, aim) {
  const above = tried.filter(({ error }) => error > aim).sort((a, b) => a.error - b.error)[0];
  const below = tried.filter(({ error }) => error <= aim).sort((a, b) => b.error - a.error)[0];
  if (above === undefined || below === undefined || above.scale <= below.scale) {
    const { scale, error } = tried.at(-1);
    return scale * Math.sqrt(aim / error);
  }
  const share = Math.log(aim / below.error) / Math.log(above.error / below.error);
  return below.scale * (above.scale / below.scale) ** Math.min(0.9, Math.max(0.1, share));
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
  const tried = [];
  for (let scale = 1; tried.length < MOST_TRIES;) {
    const found = scaledSteps(steps, scale);
    const errors = await judge.errors(found, 'heldOut');
    const error = meanOf(errors);
    tried.push({ scale, error, steps: found, decibels: decibels(error), worstDecibels: decibels(Math.max(...errors)) });
    onStep(`${decibels(error).toFixed(2)} dB in held-out views`);
    if (error <= target && error >= NEAR_ENOUGH * target) break;
    scale = nextScale(tried, AIMED * target);
  }
  tried.sort((a, b) => a.error - b.error);
  const best = tried.findLast(({ error }) => error <= target) ?? tried[0];
  evaluator.destroy();
  return { ...best, seen };
}
