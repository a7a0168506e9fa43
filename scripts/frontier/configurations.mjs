/**
 * Configurations in the chart of speed against accuracy, a line for each: its name, its aim (`tier`), and
 * how it differs from the default in options of the Renderer, of packGaussians (`pack`; `detail: true` packs levels of detail)
 * or in resolution scale. A line whose options the renderer does not have yet is left out of the chart and listed as such.
 */
export const configurations = [
  { name: 'default', tier: 'tier' },
  { name: 'reference', tier: 'tier', options: { quality: 'reference' }, pack: { sh: 'float16' } },
  { name: 'balanced', tier: 'tier', options: { quality: 'balanced' } },
  { name: 'fast', tier: 'tier', options: { quality: 'fast' } },
  { name: 'quads, float16', tier: 'variant', options: { rasterizer: 'quads', accumulation: 'rgba16float' } },
  { name: 'quads, float32', tier: 'variant', options: { rasterizer: 'quads', accumulation: 'rgba32float' } },
  { name: 'tiles', tier: 'variant', options: { rasterizer: 'tiles' } },
  { name: 'order by pixel', tier: 'setting', options: { rasterizer: 'tiles', order: 'pixel' } },
  { name: 'order by pixel, wide', tier: 'setting', options: { rasterizer: 'tiles', order: 'pixel', orderWindow: 32 } },
  { name: 'SH in float16', tier: 'setting', pack: { sh: 'float16' } },
  { name: 'SH in int8', tier: 'setting', pack: { sh: 'int8' } },
  { name: 'SH degree 1', tier: 'setting', options: { shDegree: 1 } },
  { name: 'SH degree 0', tier: 'setting', options: { shDegree: 0 } },
  { name: '16-bit keys', tier: 'setting', options: { depthKeyBits: 16 } },
  { name: '32-bit keys', tier: 'setting', options: { depthKeyBits: 32 } },
  { name: 'stop at 1/500', tier: 'setting', options: { transmittanceMin: 1 / 500 } },
  { name: 'stop at 1/64', tier: 'setting', options: { transmittanceMin: 1 / 64 } },
  { name: 'detail 0.25 px', tier: 'setting', options: { detail: 0.25 }, pack: { detail: true } },
  { name: 'detail 0.5 px', tier: 'setting', options: { detail: 0.5 }, pack: { detail: true } },
  { name: 'detail 1 px', tier: 'setting', options: { detail: 1 }, pack: { detail: true } },
  { name: 'detail 2 px', tier: 'setting', options: { detail: 2 }, pack: { detail: true } },
  ...[0.71, 0.5, 0.35, 0.25].map((resolutionScale) => ({
    ...{ name: `balanced at ${resolutionScale}`, tier: 'setting' },
    options: { quality: 'balanced', resolutionScale },
  })),
  { name: 'PlayCanvas', tier: 'peer', peer: 'playcanvas' },
  { name: 'PlayCanvas, parity', tier: 'peer', peer: 'playcanvas', parity: true },
  { name: 'Spark', tier: 'peer', peer: 'spark' },
  { name: 'Spark, parity', tier: 'peer', peer: 'spark', parity: true },
];
