/** What the checks of `npm run lab:firefox` do within a page. Everything answers with text or bytes, which any protocol carries. */
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

/** Where the camera is: theta and phi in degrees, radius and target in metres. */
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
    if (performance.now() > end) throw new Error(`waited ${limitMs} ms for ${what}; told: ${told.join('; ')}`);
    await delay(20);
  }
}

Object.assign(window, { delay, frames, show, place, until });
