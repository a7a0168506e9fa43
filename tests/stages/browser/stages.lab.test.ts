/** The cases of stages.test.ts in real Chromium: another WebGPU implementation path, another compiler. `npm test` takes every ninth, the laboratory every third, since Node has run them all. */
import { isFull, isLab } from '../../support/extent-in-pages.js';
import { runCase } from '../../support/gpu.js';
import { stageCases } from '../cases/index.js';

describe('stages in the browser', () => {
  let device: GPUDevice;

  before(async () => {
    const adapter = await navigator.gpu.requestAdapter();
    if (adapter === null) throw new Error('no WebGPU adapter in this browser');
    device = await adapter.requestDevice();
  });

  after(() => device.destroy());

  for (const stageCase of stageCases.filter((_, i) => i % (isFull ? 1 : isLab ? 3 : 9) === 0)) {
    it(stageCase.name, () => runCase(device, stageCase)).timeout(60_000);
  }
});
