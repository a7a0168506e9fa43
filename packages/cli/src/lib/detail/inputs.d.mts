import type { GaussianCloud } from '@gaussian-splat/core';

export interface SceneInput {
  readonly path: string;
  readonly transform?: readonly number[];
}

export function blocksOf(
  input: SceneInput,
  options: { readonly temporary: string; readonly maxBytes: number },
): AsyncGenerator<GaussianCloud>;
