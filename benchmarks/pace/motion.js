/** Moves the cameras frame after frame and writes down what the elements say of themselves. */

/** Longest step of the display that the cameras turn for, ms: a page that stood still does not leap. */
const LONGEST = 100;

const nextFrame = () => new Promise((resolve) => requestAnimationFrame(resolve));

/**
 * Turns the cameras for a while.
 * @param onFrame called in each frame: the page's other work
 * @returns {{at: number, interval: number, elements: {moving, drawn, target, span}[]}[]} a row for each frame of the display, its time in ms after the first
 */
export async function move(stage, seconds, { speed, onFrame = () => undefined }) {
  const rows = [];
  const lastOf = new Map();
  const start = await nextFrame();
  for (let before = start, now = start; now - start < 1000 * seconds; before = now) {
    now = await nextFrame();
    stage.turn((speed / 1000) * Math.min(LONGEST, now - before));
    onFrame();
    const elements = stage.elements.map((element) => readQuality(element, lastOf));
    rows.push({ at: now - start, interval: now - before, elements });
  }
  return rows;
}

/**
 * `span` is the duration of the last measured frame, ms from its earliest start until the GPU was done; null if no
 * frame was measured since the last call.
 */
function readQuality(element, lastOf) {
  const { moving, drawn, targetMs, lastMs } = element.stats?.dynamicQuality ?? {};
  const isNew = lastMs !== null && lastOf.has(element) && lastMs !== lastOf.get(element);
  lastOf.set(element, lastMs);
  return { moving, drawn, target: targetMs, span: isNew ? lastMs : null };
}

/** The rows of one element, with their times after a moment, ms. */
export const rowsOf = (rows, index, since = 0) =>
  rows
    .map(({ at, interval, elements }) => ({ at: at - since, interval, ...elements[index] }))
    .filter(({ at, moving }) => at >= 0 && moving !== undefined);
