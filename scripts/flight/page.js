/** The page of `npm run lab -- flight`: the element flies over a tileset, and leaves its rows in `window.report`. Its address has the parameters. */
const query = new URLSearchParams(location.search);
const number = (name) => Number(query.get(name));
const [frames, warm, speed, half] = ['frames', 'warm', 'speed', 'half'].map(number);
const [width, height] = ['width', 'height'].map(number);
const center = query.get('center').split(',').map(Number);

/** Place on the curve of bench/detail.html: low, and up once to see all of it. y points up. */
const place = (s) => [
  center[0] + 0.8 * half * Math.sin(2 * Math.PI * s),
  center[1] + 0.05 * half + 0.5 * half * Math.sin(Math.PI * s) ** 8,
  center[2] + 0.8 * half * Math.sin(4 * Math.PI * s),
];

/** Camera at a fraction of the curve, as attributes of the element, and its axis. */
function view(s) {
  const [eye, ahead] = [place(s), place(s + 0.02)];
  ahead[1] -= 0.02 * half;
  const [x, y, z] = eye.map((value, k) => value - ahead[k]);
  const radius = Math.hypot(x, y, z);
  return {
    'camera-target': ahead.map((value) => `${value}m`).join(' '),
    'camera-orbit': `${Math.atan2(x, z)}rad ${Math.atan2(Math.hypot(x, z), y)}rad ${radius}m`,
    axis: [x, y, z].map((value) => value / radius),
  };
}

const element = document.createElement('gaussian-splat');
const nextFrame = () => new Promise(requestAnimationFrame);

function fly(s) {
  const { axis, ...attributes } = view(s);
  for (const [name, value] of Object.entries(attributes)) element.setAttribute(name, value);
  element.jumpCameraToGoal();
  return axis;
}

/** Draws frames, one for each of the display. @returns a row for each */
async function run(count, shareOf) {
  const rows = [];
  let axis;
  for (let k = 0, last = await nextFrame(); k < count; k++) {
    const before = axis;
    axis = fly(shareOf(k));
    const now = await nextFrame();
    const [{ error, budgetError, bytes, resident, coming, limit }] = element.stats.streamed;
    const cosine = axis.reduce((sum, value, n) => sum + value * (before ?? axis)[n], 0);
    const turned = (180 / Math.PI) * Math.acos(Math.min(1, cosine));
    rows.push({ ms: now - last, error, budgetError, bytes, resident, coming, limit, turned });
    last = now;
  }
  return rows;
}

try {
  const { GaussianSplatElement } = await import('/cdn/gaussian-splat.min.js');
  if (query.has('megabytes')) GaussianSplatElement.memoryBudget = 1e6 * number('megabytes');
  element.style.cssText = `width: ${width}px; height: ${height}px`;
  const attributes = {
    ...{ src: query.get('src'), interpolation: '0', interaction: 'none', 'field-of-view': '53.13deg' },
    ...{ 'min-camera-orbit': 'auto 0deg auto', 'max-camera-orbit': 'auto 180deg auto' },
  };
  for (const [name, value] of Object.entries(attributes)) element.setAttribute(name, value);
  const began = performance.now();
  document.body.append(element);
  await element.ready;
  if (!element.loaded) throw element.error ?? new Error('the tileset did not load');
  const readyMs = performance.now() - began;
  await run(warm, () => 0);
  const start = performance.now();
  const rows = await run(frames, (k) => (speed * k) / 900);
  const { bytes, renderer, reasons } = element.stats;
  window.report = { readyMs, seconds: (performance.now() - start) / 1000, rows, bytes, renderer, reasons };
} catch (error) {
  window.report = { error: String(error.stack ?? error) };
}
