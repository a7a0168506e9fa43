/** Difference between two images, as they are shown. */

/**
 * @param a {HTMLElement} a `<gaussian-splat>` that shows a scene @param b {HTMLElement} another of the same size
 * @returns {Promise<{ decibels: number, worst: number }>} PSNR over the pixels that either covers, Infinity for equal images; largest
 *   difference of a color, 0..255.
 */
export async function differenceOf(a, b) {
  const [first, second] = await Promise.all([pixelsOf(a), pixelsOf(b)]);
  if (first.length !== second.length) throw new Error('The images differ in size.');
  let [squares, values, worst] = [0, 0, 0];
  for (let i = 0; i < first.length; i += 4) {
    if (first[i + 3] === 0 && second[i + 3] === 0) continue;
    for (let k = 0; k < 3; k++) {
      // Over black, as a display would show the image: colors read back are not premultiplied.
      const difference = (first[i + k] * first[i + 3] - second[i + k] * second[i + 3]) / 255;
      squares += difference ** 2;
      worst = Math.max(worst, Math.abs(difference));
      values++;
    }
  }
  return {
    decibels: squares === 0 ? Infinity : 10 * Math.log10((255 ** 2 * values) / squares),
    worst: Math.round(worst),
  };
}

async function pixelsOf(element) {
  const image = await createImageBitmap(await element.toBlob());
  const context = new OffscreenCanvas(image.width, image.height).getContext('2d');
  context.drawImage(image, 0, 0);
  return context.getImageData(0, 0, image.width, image.height).data;
}
