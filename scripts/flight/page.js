/** The page of `npm run lab -- flight`: flies over a tileset, and leaves its rows in `window.report`. Its address has the parameters. */
const query = Object.fromEntries(new URLSearchParams(location.search));
const [frames, warm, speed, half] = ['frames', 'warm', 'speed', 'half'].map((name) => Number(query[name]));
const center = query.center.split(',').map(Number);

/** Place on the curve of bench/detail.html: low, and up once to see all of it. y points up. */
const place = (s) => [
  center[0] + 0.8 * half * Math.sin(2 * Math.PI * s),
  center[1] + 0.05 * half + 0.5 * half * Math.sin(Math.PI * s) ** 8,
  center[2] + 0.8 * half * Math.sin(4 * Math.PI * s),
];

const nextFrame = () => new Promise(requestAnimationFrame);

/** Draws frames for as long as a number of them takes at 60 Hz, two at least. @returns a row for each */
async function run({ fly, progress }, count, placeAt) {
  const rows = [];
  const start = await nextFrame();
  let axis;
  for (let last = start; rows.length < 2 || 0.06 * (last - start) < count;) {
    const before = axis;
    // The clock moves the camera, so that late frames do not make the flight slower.
    axis = fly(placeAt(0.06 * (last - start)));
    const now = await nextFrame();
    const { error, budgetError, bytes, resident, coming, limit, drawMs } = progress();
    const cosine = axis.reduce((sum, value, n) => sum + value * (before ?? axis)[n], 0);
    /** Degrees a second. */
    const turned = ((180 / Math.PI) * Math.acos(Math.min(1, cosine)) * 1000) / (rows.at(-1)?.ms ?? Infinity);
    rows.push({ ms: now - last, error, budgetError, bytes, resident, coming, limit, turned, drawMs });
    last = now;
  }
  return rows;
}

try {
  const { open } = await import(query.in === 'maplibre' ? '/map/maplibre.js' : './element.js');
  const began = performance.now();
  const view = await open({ ...query, half, place, maxSplats: Number(query.maxSplats) });
  const readyMs = performance.now() - began;
  await run(view, warm, () => 0);
  const longTasks = [];
  new PerformanceObserver((list) => longTasks.push(...list.getEntries().map(({ duration }) => duration))).observe({
    type: 'longtask',
  });
  const start = performance.now();
  const rows = await run(view, frames, (k) => (speed * k) / 900);
  window.report = { readyMs, seconds: (performance.now() - start) / 1000, rows, longTasks, ...view.facts() };
} catch (error) {
  window.report = { error: String(error.stack ?? error) };
}
