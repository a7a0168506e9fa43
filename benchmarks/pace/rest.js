/**
 * Time at which the accurate frame is visible after the cameras have stopped, and its comparison with the image of
 * `toBlob()`.
 */
import { quantile } from '../run/summary.js';
import { decibels } from './figures.js';

/** Maximum duration, and interval between two checks, ms. Constant checks would take CPU time from drawing. */
const [LIMIT, LOOK] = [20_000, 1];
/** Longest side of the compared area, in pixels around the middle of the frame. */
const CROP = 1024;

const wait = (milliseconds) => new Promise((resolve) => setTimeout(resolve, milliseconds));

/** The last submitted frame of a motion, for each element. */
const lastDrawn = (elements) =>
  Promise.all(
    elements.map(
      (element) =>
        new Promise((resolve) =>
          element.addEventListener('camera-change', () => resolve(performance.now()), { once: true }),
        ),
    ),
  );

/**
 * Moves the cameras a last time and waits.
 * @returns ms from the last frame in motion until the GPU was done with the accurate frames of all elements, their
 * times, the median, and the comparison of the first visible one with `toBlob()`
 */
export async function comeToRest(stage, { compares }) {
  const { elements } = stage;
  const drawn = lastDrawn(elements);
  stage.turn(0.3);
  const since = Math.max(...(await drawn));
  const { done, shown } = await trueImages(elements);
  await wait(300);
  const wholeMs = quantile(
    elements.map(({ stats }) => stats.dynamicQuality.lastMs ?? NaN),
    0.5,
  );
  const image = compares && shown !== undefined ? await compareWithBlob(elements[0], shown) : undefined;
  return { restMs: Math.round(done - since), wholeMs: Number(wholeMs.toFixed(3)), picture: image };
}

/**
 * Waits for the accurate frames of all elements.
 * @returns time at which the GPU was done with them, and the content of the first element's canvas, which can be read
 * only in the task that draws it, by callbacks that follow the element's. This callback is therefore requested in every
 * frame
 */
async function trueImages(elements) {
  const isWhole = ({ stats }) => stats.dynamicQuality.drawn === 'whole';
  const canvas = elements[0].shadowRoot.querySelector('canvas');
  const end = performance.now() + LIMIT;
  let shown;
  let handle = 0;
  while (!elements.every(isWhole)) {
    if (performance.now() > end) throw new Error(`no reference image within ${LIMIT} ms`);
    cancelAnimationFrame(handle);
    const wasWhole = isWhole(elements[0]);
    handle = requestAnimationFrame(() => {
      if (!wasWhole && isWhole(elements[0])) shown ??= pixelsOf(canvas);
    });
    await wait(LOOK);
  }
  cancelAnimationFrame(handle);
  return { done: await submittedWorkDone(elements[0]), shown };
}

/** When the device that all elements of a page share has done what it was given. */
async function submittedWorkDone(element) {
  const lease = await element.constructor.sharedDevice.acquire();
  await lease.device.queue.onSubmittedWorkDone();
  lease.release();
  return performance.now();
}

/** The middle of a frame over black, RGBA of 8 bits. */
function pixelsOf(image) {
  const [width, height] = [image.width, image.height].map((side) => Math.min(CROP, side));
  const context = new OffscreenCanvas(width, height).getContext('2d', { willReadFrequently: true });
  context.fillStyle = 'black';
  context.fillRect(0, 0, width, height);
  const [x, y] = [(image.width - width) >> 1, (image.height - height) >> 1];
  context.drawImage(image, x, y, width, height, 0, 0, width, height);
  return context.getImageData(0, 0, width, height).data;
}

/** A PNG cannot hold colors that are brighter than their alpha, so what is compared is the canvas that the file is made of. */
async function compareWithBlob(element, shown) {
  const file = element.toBlob();
  const found = decibels(shown, pixelsOf(element.shadowRoot.querySelector('canvas')));
  await file;
  return found;
}
