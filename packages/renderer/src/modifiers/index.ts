/** What a page does to splats while they are projected: cuts, how a scene appears, a function of its own. Apart, so that pages without it do not load it. */
export { lightened, recolored, tinted, type ColorMap } from './color-maps.js';
export { CUT_SHAPES, type CutShape, type SplatCut } from './cuts.js';
export { MOST_CUTS, SplatModifier, type SplatChanges } from './splat-modifier.js';
export { SplatProgram } from './splat-program.js';
export type { SplatShader, SplatUniform } from './splat-shader.js';
