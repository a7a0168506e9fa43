/** Measuring the error of fewer pixels does not make the page wait for the GPU. */
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

/** The same image on a canvas of WebGPU. */
async function drawnByGpu(usage: GPUTextureUsageFlags): Promise<HTMLCanvasElement> {
  const device = await (await navigator.gpu.requestAdapter())!.requestDevice();
  const canvas = Object.assign(document.createElement('canvas'), { width: 300, height: 200 });
  const context = canvas.getContext('webgpu')!;
  const { COPY_DST, RENDER_ATTACHMENT } = GPUTextureUsage;
  const format = navigator.gpu.getPreferredCanvasFormat();
  const source = drawnCanvas();
  context.configure({ device, format, alphaMode: 'premultiplied', usage: usage | COPY_DST | RENDER_ATTACHMENT });
  const destination = { texture: context.getCurrentTexture(), premultipliedAlpha: true };
  device.queue.copyExternalImageToTexture({ source }, destination, [300, 200]);
  return canvas;
}

describe('what fewer pixels lose', () => {
  it('is the same from a canvas of WebGPU, which is read without a 2D canvas', async () => {
    const scales = [0.5, 0.75];
    const expected = await lossesOf(drawnCanvas(), scales, Promise.resolve());
    const { prototype } = OffscreenCanvasRenderingContext2D;
    const { getImageData } = prototype;
    prototype.getImageData = () => assert(false, 'a 2D canvas is read') as never;
    // Without an awaited frame: the copy itself waits for it.
    try {
      const canvas = await drawnByGpu(GPUTextureUsage.COPY_SRC);
      const found = await lossesOf(canvas, scales, new Promise(() => undefined));
      for (const scale of scales) {
        const [one, other] = [found.get(scale)!, expected.get(scale)!];
        assert(Math.abs(one - other) < 0.5, `${one.toFixed(2)} and ${other.toFixed(2)} dB at ${scale}`);
      }
    } finally {
      prototype.getImageData = getImageData;
    }
    const fallback = await lossesOf(await drawnByGpu(0), scales, Promise.resolve());
    assert(Math.abs(fallback.get(0.5)! - expected.get(0.5)!) < 0.5, 'of a canvas that cannot be copied');
  });

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
      const [half, max] = found.map(([, decibels]) => decibels);
      assert(half > 15 && half < 60 && max > half, `${half.toFixed(1)} and ${max.toFixed(1)} dB`);
    } finally {
      prototype.getImageData = getImageData;
    }
  });
});
