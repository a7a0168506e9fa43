import type { CalibratedView } from '@gaussian-splat/core';
import type { ViewSplit } from '@gaussian-splat/optimize';

export function parseViews(path: string): CalibratedView[];
export function dealViews(
  views: readonly CalibratedView[],
  path: string,
  rotation?: readonly number[],
): { readonly dealt: ViewSplit; readonly range: string };
