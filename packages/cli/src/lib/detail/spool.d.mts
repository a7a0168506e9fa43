import type { SceneInput } from './inputs.mjs';

export interface Spool {
  readonly count: number;
  readonly merges: number;
}

export function openSpool(
  folder: string,
  inputs: readonly SceneInput[],
  options: {
    readonly degree: number;
    readonly geometry?: string;
    readonly maxBytes: number;
    readonly facts: readonly unknown[];
    readonly divide: (spool: object) => { readonly merges: number };
  },
): Promise<Spool>;
