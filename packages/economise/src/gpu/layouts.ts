import { Cut, Lowering, MomentViews, Score, Take } from '../generated/shaders.js';

/** Layouts of the structs that economise's own shaders share with plain code. */
export const layouts = { Cut, Lowering, MomentViews, Score, Take } as const;
