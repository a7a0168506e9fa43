import { boundsOf, type GaussianCloud, type ShDegree } from '@gaussian-splat/core';
import { cloudOfChunks, decodePage } from '@gaussian-splat/renderer/tools';
import { GpuEvaluator } from '../gpu/gpu-evaluator.js';
import { decibels, mean, meanSquareOf } from '../measure.js';
import { findSteps, type Steps } from '../steps.js';
import { viewsAround, viewsFromEverywhere, type ViewSplit } from '../views.js';
import { manifestOf, type BuiltPage, type DetailTree } from './build-pages.js';
import { codingFor, PageEncoder, DEFAULT_STEPS, type PageSteps } from './encode-page.js';
import type { Deflate } from './page-planes.js';
import type { SplatVisibility } from './splat-visibility.js';

export interface PageStepsOptions {
  readonly tree: DetailTree;
  /** All pages of the tree. */
  readonly pages: readonly BuiltPage[];
  /** Source cloud of the tree. */
  readonly cloud: GaussianCloud;
  readonly device: GPUDevice;
  /** Target PSNR of the finest pages in dB, over covered pixels of held-out views. */
  readonly minPsnr: number;
  /** Number of views that measure the visibility of splats, on which the quantization of harmonics depends. */
  readonly scored: number;
  /**
   * Views in the frame of the cloud that measure visibility and errors. Default: views around the scene from outside,
   * which say little about the inside of a room.
   */
  readonly views?: ViewSplit | undefined;
  /** Compresses temporary pages that are only measured; a fast setting is sufficient. */
  readonly deflate: Deflate;
  /** Called with a sentence about each measurement. */
  readonly onStep?: (step: string) => void;
}

export interface FoundPageSteps {
  readonly steps: PageSteps;
  /** Visibility of the splats of the cloud; undefined for a cloud without harmonics. */
  readonly seen: SplatVisibility | undefined;
  /** PSNR of all held-out views together in dB. */
  readonly psnr: number;
  /** PSNR of the held-out view with the largest error in dB. */
  readonly worstPsnr: number;
}

/**
 * Finds the coarsest steps with which the finest pages have a given PSNR in held-out views. {@link findSteps} balances
 * the steps of the attributes.
 * @throws GaussianSplatError `out-of-memory/*`
 */
export async function findPageSteps(options: PageStepsOptions): Promise<FoundPageSteps> {
  const { tree, cloud, device, minPsnr, scored, onStep = () => undefined } = options;
  const around = (count: number, seed: number) => viewsAround(boundsOf(cloud), count, { seed });
  const { shDegree } = tree.levels[0];
  const everywhere = viewsFromEverywhere(boundsOf(cloud), shDegree > 0 ? scored : 1);
  const views = options.views ?? { scored: everywhere, searched: around(4, 1), heldOut: around(12, 2) };
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
      target: meanSquareOf(minPsnr),
      measure: async (steps) => mean(await evaluator.compare(await decoded(steps), 'searched')),
      judge: async (steps) => {
        const errors = await evaluator.compare(await decoded(steps), 'heldOut');
        const error = mean(errors);
        onStep(`${decibels(error).toFixed(2)} dB in held-out views`);
        return { error, psnr: decibels(error), worstPsnr: decibels(Math.max(...errors)) };
      },
    });
    return { ...found, seen };
  } finally {
    evaluator.destroy();
  }
}

/** Returns the count of a splat's numbers for each step. About half of the harmonics are 0 and do not count. */
const numbersOf = (degree: ShDegree): Partial<Steps<keyof PageSteps>> => ({
  ...{ place: 3, size: 3, direction: 3, opacity: 1, color: 1, chroma: 2 },
  ...(degree > 0 && { harmonics: 1.5 * ((degree + 1) ** 2 - 1) }),
});

/** Encodes pages with some steps, and returns the cloud of their finest level after decoding. */
async function cloudOfPages(
  { tree, pages, deflate }: Pick<PageStepsOptions, 'tree' | 'pages' | 'deflate'>,
  steps: PageSteps,
  seen: SplatVisibility | undefined,
): Promise<GaussianCloud> {
  const coding = codingFor(steps, tree);
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
