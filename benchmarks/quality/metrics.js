/** How far an image is from the reference, over black and as far as a display can show it. */
import { ssim } from 'ssim.js';
import { maxAbs, percentile, psnr } from '../../tests/support/metrics.ts';

const clamped = (value) => Math.min(1, Math.max(0, value));
const round = (value, digits) => Number(value.toFixed(digits));
/** dB that stand for equal images: JSON has no infinity. */
const EQUAL_DB = 150;
const decibels = (value) => round(Math.min(EQUAL_DB, value), 3);

/**
 * Compares [height, width, 4] premultiplied pixels over black with a reference. Both are first clamped to 0..1, because
 * displays clip brighter colors, and peers return 8 bits only.
 * @returns psnr in dB over covered pixels and `psnrAll` over all; `psnrShown` after rounding to 8 bits; `p999` and
 * `worst`, the 99.9th percentile and the largest of the differences, in 1/255; `ssim` over the box around the covered
 * pixels.
 */
export function compareImages(pixels, reference, { width, height }) {
  const color = withoutAlpha(pixels);
  const options = { mask: reference.covered, clamp: true };
  const shown = color.map((value) => Math.round(255 * clamped(value)) / 255);
  return {
    psnr: decibels(psnr(color, reference.color, options)),
    psnrAll: decibels(psnr(color, reference.color, { clamp: true })),
    psnrShown: decibels(psnr(shown, reference.color, options)),
    p999: round(255 * percentile(color, reference.color, 0.999, options), 3),
    worst: round(255 * maxAbs(color, reference.color, { clamp: true }), 2),
    ssim: round(ssimOfCovered(shown, reference, width, height), 6),
  };
}

/** The worst view in every respect. */
export function worstOf(views) {
  const min = (name) => Math.min(...views.map((view) => view[name]));
  const max = (name) => Math.max(...views.map((view) => view[name]));
  return {
    psnr: min('psnr'),
    psnrAll: min('psnrAll'),
    psnrShown: min('psnrShown'),
    p999: max('p999'),
    worst: max('worst'),
    ssim: min('ssim'),
  };
}

/** PNG file as a data URL: pixels [height, width, 3], 8 bits each, in the box around what the reference covers. */
export async function pngOfCovered(color, reference, { width, height }) {
  const box = boxOf(reference.covered, width, height);
  const canvas = new OffscreenCanvas(box.width, box.height);
  const image = new ImageData(toBytes(color, width, box).data, box.width, box.height);
  canvas.getContext('2d').putImageData(image, 0, 0);
  const blob = await canvas.convertToBlob();
  return new Promise((resolve, reject) => {
    const reader = new FileReader();
    reader.onload = () => resolve(reader.result);
    reader.onerror = () => reject(reader.error);
    reader.readAsDataURL(blob);
  });
}

/** [height, width, 3] of [height, width, 4]. */
export function withoutAlpha(pixels) {
  const color = new Float32Array((pixels.length / 4) * 3);
  for (let i = 0, j = 0; i < pixels.length; i += 4, j += 3) color.set(pixels.subarray(i, i + 3), j);
  return color;
}

/** Background that both leave black would only flatter the mean. */
function ssimOfCovered(shown, reference, width, height) {
  const box = boxOf(reference.covered, width, height);
  return ssim(toBytes(shown, width, box), toBytes(reference.color, width, box), { ssim: 'fast', downsample: false })
    .mssim;
}

/** ssim.js needs at least its window of 11 pixels. */
const SMALLEST_BOX = 11;

function boxOf(covered, width, height) {
  let [left, top, right, bottom] = [width, height, 0, 0];
  for (let i = 0; i < covered.length; i++) {
    if (!covered[i]) continue;
    const [x, y] = [i % width, Math.floor(i / width)];
    [left, right] = [Math.min(left, x), Math.max(right, x + 1)];
    [top, bottom] = [Math.min(top, y), Math.max(bottom, y + 1)];
  }
  if (right - left < SMALLEST_BOX || bottom - top < SMALLEST_BOX) return { left: 0, top: 0, width, height };
  return { left, top, width: right - left, height: bottom - top };
}

function toBytes(color, stride, { left, top, width, height }) {
  const data = new Uint8ClampedArray(4 * width * height);
  for (let y = 0; y < height; y++) {
    for (let x = 0; x < width; x++) {
      const from = 3 * (stride * (top + y) + left + x);
      const to = 4 * (width * y + x);
      for (let k = 0; k < 3; k++) data[to + k] = 255 * color[from + k];
      data[to + 3] = 255;
    }
  }
  return { data, width, height };
}
