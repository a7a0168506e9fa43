/** Levels of detail of plain files: built when asked for or when the GPU is too slow, drawn as far as the page allows, and gone without a trace. */
import '@gaussian-splat/element';
import type { GaussianSplatElement } from '@gaussian-splat/element';
import { itInLab } from '../../support/extent-in-pages.js';
import { assert, assertEqual, atRest, claimFault, frames, showLoaded, until } from './support/harness.js';

const ball = (splats: number): string => `/net/ball/red.splat?ms=0&n=${splats}`;

const AT_REST = '20deg 75deg auto';

const imageOf = async (element: GaussianSplatElement): Promise<string> => {
  const bytes = new Uint8Array(await (await element.toBlob()).arrayBuffer());
  return bytes.join();
};

/** Colors of the current frame. */
async function pixelsOf(element: GaussianSplatElement): Promise<Uint8ClampedArray> {
  const bitmap = await createImageBitmap(await element.toBlob());
  const context = new OffscreenCanvas(bitmap.width, bitmap.height).getContext('2d')!;
  context.drawImage(bitmap, 0, 0);
  return context.getImageData(0, 0, bitmap.width, bitmap.height).data;
}

const hasLevels = (element: GaussianSplatElement): boolean => (element.stats?.detail.splats ?? 0) > 0;

describe('levels of detail of a plain file', () => {
  it('are built where pixels are named, draw fewer splats, and go without a trace', async () => {
    const element = await showLoaded({ src: ball(6_000), 'camera-orbit': '0deg 75deg 300%' });
    const whole = await imageOf(element);
    const { bytes, resident } = element.stats!;
    const all = (await element.updateStats())!.drawn!;
    assert(!hasLevels(element), 'none unasked: the scene is small');
    element.detail = '4px';
    await until(() => hasLevels(element), 'levels');
    await frames(2);
    const { reasons = [], detail } = element.stats!;
    assertEqual(detail.pixels, 4, 'pixels');
    assert(detail.splats > 0.33 * resident && detail.splats < 0.6 * resident, `${detail.splats} splats more`);
    assert(element.stats!.bytes.scene > bytes.scene, 'counted');
    assert(
      reasons.some((sentence) => /merged splats.*4 px/.test(sentence)),
      `says: ${reasons.join(' ')}`,
    );
    const few = (await element.updateStats())!.drawn!;
    assert(few < 0.5 * all, `${few} of ${all} drawn`);
    assert((await imageOf(element)) !== whole, 'another frame');
    // The levels are loaded, and none of them is drawn.
    element.detail = 'auto';
    await frames(2);
    assert((await imageOf(element)) === whole, 'the full frame');
    assert(/merged splats.*only in motion/.test(element.stats!.reasons.join()), 'frames in motion may have some');
    element.quality = 'default';
    await frames(2);
    assertEqual(element.stats!.reasons, [], 'with a chosen quality no frame has any');
    element.quality = null;
    element.detail = 'off';
    await until(() => !hasLevels(element), 'no levels');
    assertEqual(element.stats!.bytes.scene, bytes.scene, 'bytes');
    assert((await imageOf(element)) === whole, 'the full frame again');
  });

  // Time by the controller's clock, which a busy machine stretches.
  itInLab('are built automatically if a large scene moves too slowly, and frames at rest stay full', async () => {
    const element = await showLoaded({ src: ball(50_000), 'camera-orbit': AT_REST }, 'width: 60px; height: 40px');
    // The camera may still be moving from its position for the first splats.
    await atRest(element);
    const whole = await pixelsOf(element);
    const start = performance.now();
    for (let degrees = 0; !hasLevels(element) && performance.now() < start + 80_000; degrees++) {
      element.cameraOrbit = `${degrees}deg 75deg auto`;
      await frames(1);
    }
    assert(hasLevels(element), `levels, with ${JSON.stringify(element.stats?.dynamicQuality)}`);
    console.log(`levels of 50,000 splats ${(performance.now() - start).toFixed(0)} ms after the first motion`);
    assertEqual(element.stats?.detail.pixels, 0, 'pixels at rest');
    element.cameraOrbit = AT_REST;
    element.jumpCameraToGoal();
    await atRest(element);
    // After a turn splats of nearly one depth may be in another order than before it, with levels or without.
    const rested = await pixelsOf(element);
    const error = rested.reduce((sum, value, i) => sum + (value - whole[i]) ** 2, 0) / rested.length;
    const decibels = 10 * Math.log10(255 ** 2 / error);
    console.log(`the frame at rest: ${decibels.toFixed(1)} dB to that before the turn`);
    assert(decibels > 50, `${decibels} dB`);
  }).timeout(120_000);

  it('a word that is none is said, and means auto', async () => {
    const element = await showLoaded({ detail: 'lots' });
    assertEqual(element.stats?.detail, { splats: 0, pixels: 0 }, 'detail');
    claimFault(/detail.*auto, off.*"lots"/);
  });
});
