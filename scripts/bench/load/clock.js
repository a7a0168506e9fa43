/**
 * One clock for all viewers: from the navigation to the page until the first frame that shows the whole scene. Fetching the viewer's code, its device and its shaders are
 * included. A frame shows the scene if the viewer has loaded it, and pixels of the canvas differ from the background.
 */

const [WIDTH, HEIGHT] = [64, 36];
/** Pixels of the reduced canvas that must differ. */
const MIN_PIXELS = 40;
/** Sum of the channels from which on a pixel differs from a black background. */
const MIN_SUM = 12;

const frame = () => new Promise(requestAnimationFrame);

/** Address of the scene of this page. */
export const url = new URLSearchParams(location.search).get('file');

/**
 * Measures a viewer, and posts the figures to `report`, if the page's address has that parameter.
 * @param {() => HTMLCanvasElement | null | undefined} canvasOf Returns the viewer's canvas.
 * @param {(note: (name: string, value?: unknown) => void) => Promise<unknown>} load Resolves when the viewer has loaded the scene. `note` records a value, by default the time.
 * @param {() => Promise<unknown>} [redraw] Makes a viewer that does not draw at rest draw the next frame.
 */
export async function measure(canvasOf, load, redraw = async () => undefined) {
  const recorded = {};
  let longestMs = 0;
  const watch = (entries) => entries.forEach(({ duration }) => (longestMs = Math.max(longestMs, duration)));
  const observer = new PerformanceObserver((list) => watch(list.getEntries()));
  observer.observe({ type: 'longtask', buffered: true });
  const note = (name, value = performance.now()) => (recorded[name] ??= value);
  try {
    note('codeMs');
    await load(note);
    note('readyMs');
    // Tasks that this measurement itself causes do not count.
    watch(observer.takeRecords());
    observer.disconnect();
    do {
      await redraw();
      await frame();
    } while (!isVisible(canvasOf()));
    note('loadMs');
    await post({ ...recorded, longestMs });
  } catch (error) {
    await post({ ...recorded, error: String(error?.message ?? error) });
  }
}

const small = new OffscreenCanvas(WIDTH, HEIGHT).getContext('2d', { willReadFrequently: true });

function isVisible(canvas) {
  if (!canvas) return false;
  small.clearRect(0, 0, WIDTH, HEIGHT);
  small.drawImage(canvas, 0, 0, WIDTH, HEIGHT);
  const { data } = small.getImageData(0, 0, WIDTH, HEIGHT);
  let pixels = 0;
  for (let at = 0; at < data.length; at += 4) if (data[at] + data[at + 1] + data[at + 2] > MIN_SUM) pixels++;
  return pixels > MIN_PIXELS;
}

async function post(result) {
  window.result = result;
  const report = new URLSearchParams(location.search).get('report');
  if (report) await fetch(report, { method: 'POST', body: JSON.stringify(result) });
}
