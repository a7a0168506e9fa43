/**
 * What the chart of speed against accuracy compares, a line for each configuration: its name, what it aims at (`tier`), and
 * how it differs from the default in options of the Renderer, of packGaussians (`pack`; `detail: true` packs levels of detail) or in resolution scale. A line whose
 * options the renderer does not have yet is left out of the chart and listed as such.
 */
export const configurations = [
  { name: 'default', tier: 'tier' },
  { name: 'reference', tier: 'tier', options: { quality: 'reference' }, pack: { sh: 'float16' } },
  { name: 'balanced', tier: 'tier', options: { quality: 'balanced' } },
  { name: 'fast', tier: 'tier', options: { quality: 'fast' } },
  { name: 'quads, float16', tier: 'variant', options: { rasterizer: 'quads', accumulation: 'rgba16float' } },
  { name: 'quads, float32', tier: 'variant', options: { rasterizer: 'quads', accumulation: 'rgba32float' } },
  { name: 'tiles', tier: 'variant', options: { rasterizer: 'tiles' } },
  { name: 'SH in float16', tier: 'lever', pack: { sh: 'float16' } },
  { name: 'SH in int8', tier: 'lever', pack: { sh: 'int8' } },
  { name: 'SH degree 1', tier: 'lever', options: { shDegree: 1 } },
  { name: 'SH degree 0', tier: 'lever', options: { shDegree: 0 } },
  { name: '16-bit keys', tier: 'lever', options: { depthKeyBits: 16 } },
  { name: '32-bit keys', tier: 'lever', options: { depthKeyBits: 32 } },
  { name: 'sort every 0.5 degrees', tier: 'lever', options: { sortAngle: 0.0087 } },
  { name: 'sort every 2 degrees', tier: 'lever', options: { sortAngle: 0.035 } },
  { name: 'stop at 1/1000', tier: 'lever', options: { transmittanceMin: 1e-3 } },
  { name: 'stop at 1/255', tier: 'lever', options: { transmittanceMin: 1 / 255 } },
  { name: 'stop at 1/64', tier: 'lever', options: { transmittanceMin: 1 / 64 } },
  { name: 'occluded below 1/100', tier: 'lever', options: { rasterizer: 'tiles', occludedBelow: 0.01 } },
  { name: 'occluded below 1/10', tier: 'lever', options: { rasterizer: 'tiles', occludedBelow: 0.1 } },
  { name: 'alpha from 2/255', tier: 'lever', options: { alphaMin: 2 / 255 } },
  { name: 'alpha from 4/255', tier: 'lever', options: { alphaMin: 4 / 255 } },
  { name: 'alpha from 8/255', tier: 'lever', options: { alphaMin: 8 / 255 } },
  { name: 'contribution from 0.5', tier: 'lever', options: { minContribution: 0.5 } },
  { name: 'contribution from 1', tier: 'lever', options: { minContribution: 1 } },
  { name: 'contribution from 3', tier: 'lever', options: { minContribution: 3 } },
  { name: 'detail 0.25 px', tier: 'lever', options: { detail: 0.25 }, pack: { detail: true } },
  { name: 'detail 0.5 px', tier: 'lever', options: { detail: 0.5 }, pack: { detail: true } },
  { name: 'detail 1 px', tier: 'lever', options: { detail: 1 }, pack: { detail: true } },
  { name: 'detail 2 px', tier: 'lever', options: { detail: 2 }, pack: { detail: true } },
  { name: 'scale 0.9', tier: 'lever', options: { resolutionScale: 0.9 } },
  { name: 'scale 0.75', tier: 'lever', options: { resolutionScale: 0.75 } },
  { name: 'scale 0.5', tier: 'lever', options: { resolutionScale: 0.5 } },
  { name: 'PlayCanvas', tier: 'peer', peer: 'playcanvas' },
  { name: 'PlayCanvas, parity', tier: 'peer', peer: 'playcanvas', parity: true },
  { name: 'Spark', tier: 'peer', peer: 'spark' },
  { name: 'Spark, parity', tier: 'peer', peer: 'spark', parity: true },
];

const BALANCED = { depthKeyBits: 16, occludedBelow: 0.03, transmittanceMin: 1 / 255, alphaMin: 1.1 / 255 };
const FAST = { depthKeyBits: 16, occludedBelow: 0.1, transmittanceMin: 1 / 100, alphaMin: 1.25 / 255 };
const SCALES = [0.84, 0.71, 0.59, 0.5, 0.42, 0.35, 0.25];

/**
 * The ladder of pictures in motion (packages/element/src/pace/ladder.ts) rung by rung, and fewer pixels alone, to tell in which order the levers come. Measured by
 * `npm run frontier -- --ladder`; tests/element/ladder.test.ts holds the two tables together.
 */
export const ladder = [
  { name: 'whole', tier: 'rung' },
  { name: 'balanced', tier: 'rung', options: BALANCED },
  { name: 'fast', tier: 'rung', options: FAST },
  ...SCALES.map((resolutionScale) => ({
    name: `fast at ${resolutionScale}`,
    tier: 'rung',
    options: { ...FAST, resolutionScale },
  })),
  { name: 'whole at 0.84', tier: 'lever', options: { resolutionScale: 0.84 } },
  { name: 'whole at 0.5', tier: 'lever', options: { resolutionScale: 0.5 } },
];
