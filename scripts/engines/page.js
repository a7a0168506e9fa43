/** The checks of `npm run lab -- firefox` and `npm run lab -- webkit` within a page. Every function returns text or bytes, which any protocol carries. */
const SIZE = 'display: block; width: 300px; height: 240px';

const delay = (ms) => new Promise((resolve) => setTimeout(resolve, ms));
const frames = async (count = 2) => {
  for (let i = 0; i < count; i++) await new Promise(requestAnimationFrame);
};

/** The only element of the page, with these attributes, once there is nothing left to wait for. */
async function show(attributes) {
  await customElements.whenDefined('gaussian-splat');
  document.body.replaceChildren();
  const element = document.createElement('gaussian-splat');
  element.style.cssText = SIZE;
  window.told = [];
  for (const type of ['error', 'generator-error', 'generator-fallback', 'contextlost', 'contextrestored', 'seeked'])
    element.addEventListener(type, ({ detail }) =>
      told.push([type, detail?.message ?? detail?.reason ?? ''].join(' ').trim()),
    );
  for (const [name, value] of Object.entries(attributes)) element.setAttribute(name, value);
  document.body.append(element);
  await element.ready;
  if (element.error) throw new Error(element.error.message);
  window.element = element;
  return element;
}

/** Camera position: theta and phi in degrees, radius and target in meters. */
async function place() {
  element.jumpCameraToGoal();
  await frames();
  const { theta, phi, radius } = element.getCameraOrbit();
  const { x, y, z } = element.getCameraTarget();
  return JSON.stringify([...[theta, phi].map((angle) => (angle * 180) / Math.PI), radius, x, y, z]);
}

/** Waits until something holds, or says what did not. */
async function until(condition, what, limitMs = 20_000) {
  const end = performance.now() + limitMs;
  while (!condition()) {
    if (performance.now() > end)
      throw new Error(`waited ${limitMs} ms for ${what}; reported: ${(window.told ?? []).join('; ')}`);
    await delay(20);
  }
}

/** Final states of the scenes of a page: each is scrolled to, its poster dismissed. */
async function scenesOfPage() {
  const scenes = [...document.querySelectorAll('gaussian-splat')];
  const faults = [];
  for (const scene of scenes) {
    scene.scrollIntoView({ block: 'center', behavior: 'instant' });
    scene.dismissPoster();
    await until(() => scene.loaded || scene.error, `the scene ${scene.src}`, 60_000);
    if (scene.error) faults.push(`${scene.src}: ${scene.error.reason}`);
    else if (!(await paints(scene))) faults.push(`${scene.src}: blank`);
  }
  // Scenes that need WebGPU report it.
  const refused = faults.filter((fault) => /unsupported\/webgl$/.test(fault)).length;
  scrollTo(0, 0);
  await delay(500);
  if (faults.length > refused) return faults.join(', ');
  return `${scenes.length} scenes, ${refused} of them refused by name`;
}

async function paints(scene) {
  const image = new Image();
  image.src = scene.toDataURL();
  await image.decode();
  const canvas = Object.assign(document.createElement('canvas'), { width: 64, height: 64 });
  const context = canvas.getContext('2d');
  context.drawImage(image, 0, 0, 64, 64);
  return context.getImageData(0, 0, 64, 64).data.some((value, i) => i % 4 === 3 && value > 128);
}

/** WebGL contexts that the page created, and errors that it threw. */
window.contexts = [];
const { getContext } = HTMLCanvasElement.prototype;
HTMLCanvasElement.prototype.getContext = function watching(...args) {
  const context = getContext.apply(this, args);
  if (args[0] === 'webgl2' && context && !contexts.includes(context)) contexts.push(context);
  return context;
};
window.thrown = [];
addEventListener('error', ({ message }) => thrown.push(message));
addEventListener('unhandledrejection', ({ reason }) => thrown.push(String(reason)));

Object.assign(window, { delay, frames, show, place, until, scenesOfPage });
