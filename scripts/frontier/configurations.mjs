/**
 * What the chart of speed against accuracy compares, a line for each configuration: its name, what it aims at (`tier`), and
 * how it differs from the default in options of the Renderer, of packGaussians (`pack`) or in resolution scale. A line whose
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
  { name: 'alpha from 2/255', tier: 'lever', options: { alphaMin: 2 / 255 } },
  { name: 'alpha from 4/255', tier: 'lever', options: { alphaMin: 4 / 255 } },
  { name: 'alpha from 8/255', tier: 'lever', options: { alphaMin: 8 / 255 } },
  { name: 'contribution from 0.5', tier: 'lever', options: { minContribution: 0.5 } },
  { name: 'contribution from 1', tier: 'lever', options: { minContribution: 1 } },
  { name: 'contribution from 3', tier: 'lever', options: { minContribution: 3 } },
  { name: 'scale 0.9', tier: 'lever', options: { resolutionScale: 0.9 } },
  { name: 'scale 0.75', tier: 'lever', options: { resolutionScale: 0.75 } },
  { name: 'scale 0.5', tier: 'lever', options: { resolutionScale: 0.5 } },
  { name: 'PlayCanvas', tier: 'peer', peer: 'playcanvas' },
  { name: 'PlayCanvas, parity', tier: 'peer', peer: 'playcanvas', parity: true },
  { name: 'Spark', tier: 'peer', peer: 'spark' },
  { name: 'Spark, parity', tier: 'peer', peer: 'spark', parity: true },
];
