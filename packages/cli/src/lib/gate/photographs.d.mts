import type { Photograph } from './gate.mjs';
export function readPhotographs(path: string, images?: string, leftOut?: readonly string[]): Photograph[];
export function holdOut(
  photographs: readonly Photograph[],
  every: number,
): { judging: readonly Photograph[]; others: readonly Photograph[] };
