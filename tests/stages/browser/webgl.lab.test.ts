/** The WebGL renderer against the float64 oracle, on scenes that are hard in one way each. */
import { packGaussians, type AccumulationFormat } from '@gaussian-splat/renderer';
import { DATA_WIDTH, GlGaussians, GlRenderer } from '@gaussian-splat/renderer/webgl';
import { renderOracle, toRgba, type Mode } from '../../oracle/oracle.js';
import { cloudOf } from '../../support/clouds.js';
import { drawWithWebGl } from '../../support/draw-with-webgl.js';
import { psnr } from '../../support/metrics.js';
import { cameraAt, proceduralScenes, resized, thinned } from '../../support/scenes.js';
import { assert } from '../../element/browser/support/harness.js';

/** dB that an image of 8 bits must reach in its worst view: rounding alone leaves 58.9 dB. */
const MIN_DB = 45;
/** Enough of each scene to distinguish faults. */
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

it('WebGL: points of a frame of fewer pixels are those of the displayed frame', async () => {
  const camera = cameraAt([0, 0, -6], [0, 0, 0], { width: 96, height: 64 });
  const gl = document.createElement('canvas').getContext('webgl2');
  if (gl === null) throw new Error('no WebGL 2 in this browser');
  const packed = packGaussians(cloudOf([{ position: [1.2, 0.6, 0], scale: 0.2, opacity: 0.95, color: [1, 1, 1] }]));
  const gaussians = await GlGaussians.upload(gl, packed);
  const renderer = new GlRenderer(gl, gaussians);
  renderer.setOrder(new Uint32Array(DATA_WIDTH), 1);
  const m = camera.worldToCamera;
  const [x, y, z] = [0, 4, 8].map((row) => 1.2 * m[row] + 0.6 * m[row + 1] + m[row + 3]);
  const center = { x: (camera.fx * x) / z + camera.cx, y: (camera.fy * y) / z + camera.cy };
  const aside = { x: camera.width - center.x, y: camera.height - center.y };
  for (const resolutionScale of [1, 0.5, 0.25]) {
    renderer.render({ camera, accumulation: 'rgba16float', shDegree: 0, resolutionScale });
    const [hit, missed] = await renderer.probe([center, aside]);
    assert(hit.opacity > 0.9 && Math.abs(hit.depth! - z) < 0.05, `at ${resolutionScale}: ${JSON.stringify(hit)}`);
    assert(missed.opacity === 0, `beside it, at ${resolutionScale}: ${JSON.stringify(missed)}`);
  }
  renderer.destroy();
  gaussians.destroy();
  gl.getExtension('WEBGL_lose_context')?.loseContext();
});
