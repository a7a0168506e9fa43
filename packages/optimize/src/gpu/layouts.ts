import { Cut, Lowering, MomentViews, RefineStep, RefineView, Score, Take } from '../generated/shaders.js';

/** Default values of the fields of `View` that the shaders of this package do not use. */
export const NO_VIEW = {
  ...{ page: 0, first_group: 0, sh_degree: 0, sh_cap: 0, sh_encoding: 0, key_bits: 0 },
  ...{ has_detail: 0, detail: 0, detail_fade: 0, splat_budget: 0 },
  ...{ opacity: 1, crop_low: [0, 0, 0], crop_high: [0, 0, 0] },
};

/** Layouts of the structs that the shaders of this package share with TypeScript. */
export const layouts = { Cut, Lowering, MomentViews, RefineStep, RefineView, Score, Take } as const;
