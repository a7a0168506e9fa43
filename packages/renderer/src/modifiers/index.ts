/**
 * Modifies splats during projection: cuts, reveal effects, and hooks of a page. A separate entry point, so that other
 * pages do not load it.
 */
export { lightened, recolored, tinted, type ColorMap } from './color-maps.js';
export { CUT_SHAPES, directionIn, type CutShape, type SplatCut } from './cuts.js';
export { type SplatGroupIds } from './group-textures.js';
export { MAX_CUTS, SplatModifier, type SplatChanges } from './splat-modifier.js';
export { SplatProgram } from './splat-program.js';
export type { SplatShader, SplatUniform } from './splat-shader.js';
