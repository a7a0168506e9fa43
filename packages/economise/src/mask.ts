import type { GaussianCloud } from '@gaussian-splat/core';
import { reduce, type ReducedCloud } from './reduce.js';
import type { Scores } from './score.js';

/**
 * How much of a scene is shown: a share of its splats in 0..1, the most seen ones, or `null` for all. The scene itself is never
 * changed, so that every choice can be taken back.
 */
export type EconomyShare = number | null;

/** Reads the `economy` attribute: a number in 0..1 or a percentage is a share; anything else is all. */
export function parseEconomy(text: string | null): EconomyShare {
  const match = /^\s*(\d*\.?\d+)\s*(%?)\s*$/.exec(text ?? '');
  if (!match) return null;
  const share = Number(match[1]) / (match[2] ? 100 : 1);
  return share > 0 && share < 1 ? share : null;
}

/** How much of a scene a mask leaves: a share of the splats, or as few as keep the picture to a figure. */
export type MaskGoal = { readonly share: number } | { readonly decibels: number };

/** What the attribute `economy` may ask for: a mask for all views alike, or that each view leaves out what does not show from its side. */
export type EconomyGoal = MaskGoal | 'views';

/** Reads the `economy` attribute: a share as {@link parseEconomy} has it, dB such as `57db`, or `views`; null for anything else, which is all. */
export function parseEconomyGoal(text: string | null): EconomyGoal | null {
  if (text?.trim() === 'views') return 'views';
  const figure = /^\s*(\d*\.?\d+)\s*db\s*$/i.exec(text ?? '');
  if (figure) return Number(figure[1]) > 0 ? { decibels: Number(figure[1]) } : null;
  const share = parseEconomy(text);
  return share === null ? null : { share };
}

/** The contribution that a splat needs to be among the given share of those that paint anything at all. */
export function contributionOfShare({ contribution }: Pick<Scores, 'contribution'>, share: EconomyShare): number {
  if (share === null) return 0;
  const sorted = contribution.slice().sort();
  return sorted[Math.min(sorted.length - 1, Math.floor((1 - share) * sorted.length))];
}

/** The splats of a scene that are shown at a share. */
export function economical(cloud: GaussianCloud, scores: Scores, share: EconomyShare): ReducedCloud {
  return reduce(cloud, scores, { minContribution: contributionOfShare(scores, share) });
}
