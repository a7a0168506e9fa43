import { Cut, Lowering, MomentViews, RefineStep, RefineView, Score, Take } from '../generated/shaders.js';

/** Layouts of the structs that economise's own shaders share with plain code. */
export const layouts = { Cut, Lowering, MomentViews, RefineStep, RefineView, Score, Take } as const;
