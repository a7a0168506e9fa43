/**
 * What the chart of speed against accuracy compares, a line for each configuration: its name, what it aims at (`tier`), and
 * how it differs from the default in options of the Renderer, of packGaussians (`pack`) or in resolution scale. A line whose
 * options the renderer does not have yet is left out of the chart and listed as such.
 */
export const configurations = [
  { name: 'default', tier: 'default' },
  { name: 'quads', tier: 'default', options: { rasterizer: 'quads' } },
  { name: 'tiles', tier: 'default', options: { rasterizer: 'tiles' } },
  { name: 'tiles, float32', tier: 'reference', options: { rasterizer: 'tiles', accumulation: 'rgba32float' } },
  {
    name: 'tiles, float32, 32-bit keys',
    tier: 'reference',
    options: { rasterizer: 'tiles', accumulation: 'rgba32float', depthKeyBits: 32 },
  },
  { name: 'quads, float32', tier: 'reference', options: { rasterizer: 'quads', accumulation: 'rgba32float' } },
  { name: 'quads, 16-bit keys', tier: 'lever', options: { rasterizer: 'quads', depthKeyBits: 16 } },
  { name: 'tiles, 16-bit keys', tier: 'lever', options: { rasterizer: 'tiles', depthKeyBits: 16 } },
  { name: 'tiles, stop at 1/1000', tier: 'lever', options: { rasterizer: 'tiles', transmittanceMin: 1e-3 } },
  { name: 'tiles, stop at 1/255', tier: 'lever', options: { rasterizer: 'tiles', transmittanceMin: 1 / 255 } },
  { name: 'alpha from 2/255', tier: 'lever', options: { alphaMin: 2 / 255 } },
  { name: 'SH degree 2', tier: 'lever', options: { shDegree: 2 } },
  { name: 'SH degree 1', tier: 'lever', options: { shDegree: 1 } },
  { name: 'SH degree 0', tier: 'lever', options: { shDegree: 0 } },
  { name: 'SH in int8', tier: 'lever', pack: { sh: 'int8' } },
  { name: 'contribution from 1', tier: 'lever', options: { minContribution: 1 } },
  { name: 'contribution from 3', tier: 'lever', options: { minContribution: 3 } },
  { name: 'quality reference', tier: 'tier', options: { quality: 'reference' } },
  { name: 'quality balanced', tier: 'tier', options: { quality: 'balanced' } },
  { name: 'quality fast', tier: 'tier', options: { quality: 'fast' } },
  { name: 'scale 0.75', tier: 'lever', resolutionScale: 0.75 },
  { name: 'scale 0.5', tier: 'lever', resolutionScale: 0.5 },
  { name: 'PlayCanvas', tier: 'peer', peer: 'playcanvas' },
  { name: 'PlayCanvas, parity', tier: 'peer', peer: 'playcanvas', parity: true },
  { name: 'Spark', tier: 'peer', peer: 'spark' },
  { name: 'Spark, parity', tier: 'peer', peer: 'spark', parity: true },
];
