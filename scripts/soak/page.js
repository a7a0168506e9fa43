/** The page's side of `npm run lab -- soak`: what can be done to elements, by name. */
import { metaQuest3, XRDevice } from '/iwer/iwer.module.min.js';
import { devices, faults, ledger } from './ledger.js';

/** An emulated headset, before the element asks for one. */
new XRDevice(metaQuest3).installRuntime({ forceInstall: true });

const { GaussianSplatElement } = await import('/cdn/gaussian-splat.min.js');
GaussianSplatElement.releaseDelay = 0;

const walk = document.querySelector('#walk');
const MAX = 4;
const delay = (ms) => new Promise((resolve) => setTimeout(resolve, ms));
const pick = (list, share) => list[Math.min(list.length - 1, Math.floor(share * list.length))];
const SOURCES = [
  '/scenes/skull.spz',
  '/fixtures/compass.splat',
  '/fixtures/green.splat',
  '/fixtures/compass.ply',
  '/fixtures/truncated.ply',
  '/fixtures/none.ply',
  '/generators/packed.onnx',
  '/generators/split.onnx',
  '/generators/faulty-run.onnx',
  '/scenes/vase.gsv',
  '/scenes/knot/knot.gsv',
];
const QUALITIES = ['reference', 'default', 'balanced', 'fast'];
const events = {};
/** How often the anchor has lost its device, and has come back. */
let [lost, restored] = [0, 0];

function addElement(share) {
  if (walk.children.length >= MAX) return;
  const element = document.createElement('gaussian-splat');
  element.style.cssText = 'display: inline-block; width: 120px; height: 90px';
  element.setAttribute('loading', 'eager');
  element.setAttribute('src', pick(SOURCES, share));
  for (const type of ['load', 'error', 'contextlost', 'contextrestored', 'generator-error', 'generator-fallback']) {
    element.addEventListener(type, () => (events[type] = (events[type] ?? 0) + 1));
  }
  walk.append(element);
}

/** Each does one thing to a random element; a and b are in 0..1. */
const ACTIONS = {
  add: (_, a) => addElement(a),
  remove: (element) => element.remove(),
  move: (element) => walk.prepend(element),
  load: (element, a) => element.setAttribute('src', pick(SOURCES, a)),
  swap: (element, a, b) => [a, b, a, b].forEach((share) => element.setAttribute('src', pick(SOURCES, share))),
  empty: (element) => element.removeAttribute('src'),
  resize: (element, a, b) => {
    element.style.width = `${Math.floor(a * 200)}px`;
    element.style.height = `${Math.floor(b * 150)}px`;
  },
  nothing: (element) => (element.style.width = '0'),
  hide: (element, a) => (element.style.display = a < 0.5 ? 'none' : 'inline-block'),
  scroll: (element, a) => (element.style.marginTop = a < 0.5 ? '4000px' : ''),
  turn: (element, a, b) => element.setAttribute('camera-orbit', `${360 * a}deg ${20 + 140 * b}deg auto`),
  child: (element, a) => {
    if (element.querySelector('splat-scene, splat-mesh'))
      return element.querySelector('splat-scene, splat-mesh').remove();
    const child = document.createElement(a < 0.8 ? 'splat-scene' : 'splat-mesh');
    child.setAttribute('src', a < 0.8 ? pick(SOURCES.slice(0, 6), a / 0.8) : '/fixtures/textured.glb');
    element.append(child);
  },
  label: (element, a, b) => {
    if (element.querySelector('button')) return element.querySelector('button').remove();
    element.insertAdjacentHTML('beforeend', `<button slot="hotspot-a" data-position="${a} ${b} 0">a</button>`);
  },
  renderer: (element, a) => element.setAttribute('renderer', a < 0.5 ? 'webgl' : 'auto'),
  detail: (element, a) => element.setAttribute('detail', a < 0.5 ? '2px' : 'auto'),
  save: (element) => void element.toBlob().catch(() => undefined),
  look: (element, a, b) => void element.positionFromPoint(120 * a, 90 * b),
  quality: (element, a) => element.setAttribute('quality', pick(QUALITIES, a)),
  play: (element) => void element.play().catch(() => undefined),
  pause: (element) => element.pause(),
  seek: (element, a) => element.setAttribute('time', String(6 * a)),
  rate: (element, a) => (element.playbackRate = pick([-1, 0.25, 1, 4], a)),
  record: (element, a) => void element.record({ duration: 100 + 600 * a }).catch(() => undefined),
  /** Enters VR, and leaves it again, unless something else has ended the session. */
  session: async (element, a) => {
    element.setAttribute('vr', '');
    await delay(300);
    element.shadowRoot.querySelector('[part=vr-button]')?.click();
    await delay(200 + 1_500 * a);
    element.exitXR?.();
  },
  pose: (element, a, b) => element.setAttribute('pose', `[[${a}, 0, 0], [0, 0, ${b}]]`),
  nonsense: (element, a) => element.setAttribute('camera-orbit', pick(['', 'x y z', '1e999deg 0 0', '<b>'], a)),
  loseDevice: () => devices.at(-1)?.device.destroy(),
  pageHidden: async () => {
    Object.defineProperty(document, 'visibilityState', { configurable: true, get: () => 'hidden' });
    document.dispatchEvent(new Event('visibilitychange'));
    await delay(100);
    Reflect.deleteProperty(document, 'visibilityState');
    document.dispatchEvent(new Event('visibilitychange'));
  },
};

const NEEDS_NONE = new Set(['add', 'loseDevice', 'pageHidden']);

async function act(name, which, a, b) {
  const element = pick([...walk.children], which);
  if (element === undefined && !NEEDS_NONE.has(name)) return addElement(a);
  await ACTIONS[name](element, a, b);
}

/** Everything but the anchor is gone, and pending work has ended. */
async function settle() {
  walk.replaceChildren();
  let last = '';
  // Until the books stand still: releases, restorations and late loads take a while.
  for (let still = 0, tries = 0; still < 6 && tries < 600; tries++) {
    await delay(100);
    // Resources handed to the GPU process must have been returned, too.
    await Promise.all(devices.map(({ device }) => device.queue.onSubmittedWorkDone().catch(() => undefined)));
    const anchor = document.querySelector('#anchor');
    const now = JSON.stringify([ledger(), anchor?.loaded, devices.length]);
    // Between the two events a lost anchor still counts as loaded, and shows its last frame.
    const isThere = anchor.loaded && lost === restored;
    still = now === last && isThere ? still + 1 : 0;
    last = now;
  }
  const anchor = document.querySelector('#anchor');
  return {
    loaded: anchor.loaded && lost === restored,
    error: anchor.error?.message,
    devices: devices.length,
    ledger: ledger(),
  };
}

async function start() {
  const anchor = document.createElement('gaussian-splat');
  anchor.id = 'anchor';
  anchor.setAttribute('loading', 'eager');
  anchor.setAttribute('src', '/scenes/skull.spz');
  anchor.setAttribute('interpolation-decay', '0');
  anchor.addEventListener('contextlost', () => lost++);
  anchor.addEventListener('contextrestored', () => restored++);
  document.body.append(anchor);
  await anchor.ready;
  return settle();
}

window.soak = {
  start,
  act,
  settle,
  actions: Object.keys(ACTIONS),
  faults: () => faults.splice(0),
  events: () => events,
};
