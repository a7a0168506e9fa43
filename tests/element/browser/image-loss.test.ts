/** What fewer pixels lose of an image is found without keeping the page waiting for the GPU. */
import type * as imageLoss from '../../../packages/element/src/dynamic-quality/image-loss.js';
import { assert, assertEqual, delay } from './support/harness.js';

const { lossesOf } = (await import(
  new URL('/packages/element/dist/dynamic-quality/image-loss.js', location.href).href
)) as typeof imageLoss;

/** A gradient with a sharp edge. */
function drawnCanvas(): HTMLCanvasElement {
  const canvas = Object.assign(document.createElement('canvas'), { width: 300, height: 200 });
  const context = canvas.getContext('2d')!;
  const gradient = context.createLinearGradient(0, 0, 300, 0);
  gradient.addColorStop(0, '#000');
  gradient.addColorStop(0.5, '#fff');
  gradient.addColorStop(0.5, '#f00');
  gradient.addColorStop(1, '#0ff');
  context.fillStyle = gradient;
  context.fillRect(20, 20, 260, 160);
  return canvas;
}

describe('what fewer pixels lose', () => {
  it('is read once the frame is drawn, in two round trips', async () => {
    const { prototype } = OffscreenCanvasRenderingContext2D;
    const { getImageData } = prototype;
    let readings = 0;
    prototype.getImageData = function counting(
      this: OffscreenCanvasRenderingContext2D,
      ...args: Parameters<typeof getImageData>
    ) {
      readings++;
      return getImageData.apply(this, args);
    } as typeof getImageData;
    try {
      let finish: () => void = () => undefined;
      const losses = lossesOf(drawnCanvas(), [0.5, 0.75], new Promise<void>((resolve) => (finish = resolve)));
      await delay(100);
      assertEqual(readings, 0, 'readings before the GPU is done');
      finish();
      const found = [...(await losses)];
      assertEqual(readings, 2, 'readings');
      assertEqual(
        found.map(([scale]) => scale),
        [0.5, 0.75],
        'scales',
      );
      const [half, most] = found.map(([, decibels]) => decibels);
      assert(half > 15 && half < 60 && most > half, `${half.toFixed(1)} and ${most.toFixed(1)} dB`);
    } finally {
      prototype.getImageData = getImageData;
    }
  });
});
