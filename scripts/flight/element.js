/** The element of `npm run lab -- flight`. */

/** Camera at a fraction of the curve, as attributes of the element, and its axis. */
function view(s, { place, half }) {
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

export async function open({ src, megabytes, width, height, ...path }) {
  const { GaussianSplatElement } = await import('/cdn/gaussian-splat.min.js');
  if (megabytes) GaussianSplatElement.memoryBudget = 1e6 * megabytes;
  const element = document.createElement('gaussian-splat');
  element.style.cssText = `width: ${width}px; height: ${height}px`;
  const constants = {
    ...{ src, interpolation: '0', interaction: 'none', 'field-of-view': '53.13deg' },
    ...{ 'min-camera-orbit': 'auto 0deg auto', 'max-camera-orbit': 'auto 180deg auto' },
  };
  const set = (attributes) => Object.entries(attributes).forEach(([name, value]) => element.setAttribute(name, value));
  set(constants);
  document.body.append(element);
  await element.ready;
  if (!element.loaded) throw element.error ?? new Error('the tileset did not load');
  return {
    fly(s) {
      const { axis, ...attributes } = view(s, path);
      set(attributes);
      element.jumpCameraToGoal();
      return axis;
    },
    progress: () => element.stats.streamed[0],
    facts() {
      const { bytes, renderer, reasons } = element.stats;
      return { megabytes: { scene: bytes.scene / 1e6, frames: bytes.frames / 1e6 }, renderer, reasons };
    },
  };
}
