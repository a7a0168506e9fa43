/** The WebGL renderer against the float64 oracle, on scenes that are hard in one way each. */
import { packGaussians, type AccumulationFormat } from '@gaussian-splat/renderer';
import { renderOracle, toRgba, type Mode } from '../../oracle/oracle.js';
import { drawWithWebGl } from '../../support/draw-with-webgl.js';
import { psnr } from '../../support/metrics.js';
import { proceduralScenes, resized, thinned } from '../../support/scenes.js';
import { assert } from '../../element/browser/support/harness.js';

/** dB that an image of 8 bits must reach in its worst view: rounding alone leaves 58.9 dB. */
const MIN_DB = 45;
/** Enough of each scene to tell faults apart. */
const SPLATS = 4_000;
const WIDTH = 160;

describe('WebGL, against the oracle', () => {
  for (const makeScene of proceduralScenes) {
    it(makeScene.name, async () => {
      const { cloud, cameras } = thinned(makeScene(), SPLATS);
      for (const [i, mode] of (['classic', 'antialiased'] as readonly Mode[]).entries()) {
        const camera = resized(cameras[i % cameras.length], WIDTH);
        const oracle = renderOracle(cloud, camera, { rules: 'gsplat', mode });
        const accumulation: AccumulationFormat = i === 0 ? 'rgba16float' : 'rgba32float';
        const packed = packGaussians(
          { ...cloud, antialiased: mode === 'antialiased' },
          { sh: i === 0 ? 'auto' : 'float16' },
        );
        const found = await drawWithWebGl(packed, camera, accumulation);
        const decibels = psnr(found, toRgba(oracle), { mask: oracle.contributors, channels: 4, clamp: true });
        assert(decibels >= MIN_DB, `${makeScene.name} ${mode}: ${decibels.toFixed(1)} dB`);
      }
    });
  }
});
