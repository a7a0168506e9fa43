import { boundsOf, type GaussianCloud, type ShDegree } from '@gaussian-splat/core';
import { cloudOfChunks, decodePage } from '@gaussian-splat/renderer/tools';
import { GpuEvaluator } from '../gpu/gpu-evaluator.js';
import { decibels, mean, meanSquareOf } from '../measure.js';
import { findSteps, type Steps } from '../steps.js';
import { viewsAround, viewsFromEverywhere } from '../views.js';
import { manifestOf, type BuiltPage, type DetailTree } from './build-pages.js';
import { codingFor, PageEncoder, DEFAULT_STEPS, type PageSteps } from './encode-page.js';
import type { Deflate } from './page-planes.js';
import type { SplatVisibility } from './seen-splats.js';

export interface PageStepsOptions {
  readonly tree: DetailTree;
  /** All pages of the tree. */
  readonly pages: readonly BuiltPage[];
  /** The cloud that the tree was built from. */
  readonly cloud: GaussianCloud;
  readonly device: GPUDevice;
  /** PSNR over covered pixels of held-out views for the finest pages, dB. */
  readonly minDecibels: number;
  /** Number of views for the visibility of splats, which controls the quantization of harmonics. */
  readonly scored: number;
  /** Compresses temporary pages for measurements: a fast setting suffices. */
  readonly deflate: Deflate;
  /** Called with a sentence about each measurement. */
  readonly onStep?: (step: string) => void;
}

export interface FoundPageSteps {
  readonly steps: PageSteps;
  /** Visibility of the splats of the cloud; undefined for a cloud without harmonics. */
  readonly seen: SplatVisibility | undefined;
  /** PSNR of all held-out views together, and of the worst one. */
  readonly decibels: number;
  readonly worstDecibels: number;
}

/**
 * Finds the coarsest steps with a given PSNR of the finest pages in held-out views. Attributes whose rounding is less
 * visible get larger steps.
 * @throws GaussianSplatError `out-of-memory/*`
 */
export async function findPageSteps(options: PageStepsOptions): Promise<FoundPageSteps> {
  const { tree, cloud, device, minDecibels, scored, onStep = () => undefined } = options;
  const around = (count: number, seed: number) => viewsAround(boundsOf(cloud), count, { seed });
  const { shDegree } = tree.levels[0];
  const everywhere = viewsFromEverywhere(boundsOf(cloud), shDegree > 0 ? scored : 1);
  const views = { scored: everywhere, searched: around(4, 1), heldOut: around(12, 2) };
  const evaluator = await GpuEvaluator.create(device, cloud, views, {
    onScored: (done, all) => onStep(`${done} of ${all} views show how splats are seen`),
  });
  try {
    if (shDegree > 0) await evaluator.rank();
    const seen = shDegree > 0 ? await evaluator.seen() : undefined;
    const decoded = (steps: PageSteps) => cloudOfPages(options, steps, seen);
    const found = await findSteps({
      usual: DEFAULT_STEPS as Steps<keyof PageSteps>,
      numbers: numbersOf(shDegree),
      target: meanSquareOf(minDecibels),
      measure: async (steps) => mean(await evaluator.compare(await decoded(steps), 'searched')),
      judge: async (steps) => {
        const errors = await evaluator.compare(await decoded(steps), 'heldOut');
        const error = mean(errors);
        onStep(`${decibels(error).toFixed(2)} dB in held-out views`);
        return { error, decibels: decibels(error), worstDecibels: decibels(Math.max(...errors)) };
      },
    });
    return { ...found, seen };
  } finally {
    evaluator.destroy();
  }
}

/** Numbers of a splat for each step. About half of the harmonics are 0 and cost little. */
const numbersOf = (degree: ShDegree): Partial<Steps<keyof PageSteps>> => ({
  ...{ place: 3, size: 3, direction: 3, opacity: 1, color: 1, chroma: 2 },
  ...(degree > 0 && { harmonics: 1.5 * ((degree + 1) ** 2 - 1) }),
});

/** Decodes the finest level of coded pages. */
async function cloudOfPages(
  { tree, pages, deflate }: Pick<PageStepsOptions, 'tree' | 'pages' | 'deflate'>,
  steps: PageSteps,
  seen: SplatVisibility | undefined,
): Promise<GaussianCloud> {
  const coding = codingFor(steps);
  const encoder = new PageEncoder(tree, coding, { deflate, seen });
  const scene = manifestOf(tree, [], String, coding);
  const parts = [];
  for (const page of pages) {
    const { chunks, upper, holds } = page;
    const leaves = holds.flatMap(([level], chunk) => (level === 0 ? [chunk] : []));
    if (leaves.length === 0) continue;
    const file = { chunks, upper, shDegree: scene.shDegree, coding };
    const words = new Uint32Array(await decodePage('page', encoder.encode(page), file));
    parts.push({ words, of: chunks, chunks: leaves });
  }
  return cloudOfChunks(scene, parts);
}
