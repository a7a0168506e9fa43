/** Chips of the first page: each shows in the scene what one attribute or one child does, and its HTML. */
import { poseOf } from '../examples/poses.js';

const WALKER = 'generators/walker/model.onnx';
/** Points that a chip clicks, in heights of the scene from its middle: the floor before the door, and two corners of the low table from above it. */
const TO_DOOR = [0.46, 0.38];
const TABLE = [
  [-0.057, 0.213],
  [0.216, -0.065],
];
const ABOVE_TABLE = { orbit: '-53.1deg 51.3deg 1.92m', target: '1.8m 0.4m 2.1m' };

const tag = (attributes, children = '') =>
  `<gaussian-splat src="apartment.spz" alt="A living room" camera-controls${attributes}>${children}</gaussian-splat>`;
const child = (attributes) => `\n  <splat-scene ${attributes}></splat-scene>\n`;
const VASE = 'position="2.9m 0 2.2m" scale="0.7" autoplay loop';
const PERSON = 'position="2.7m 0.83m 2.2m" rotation="0 -60deg 0"';

const CHIPS = {
  walk: {
    html: tag(' unit="1m"\n  navigation="walk" walk-map="apartment.floor"'),
    said: 'Click the floor to walk there, or use the arrow keys.',
  },
  measure: { html: tag(' unit="1m" measure'), said: 'Click two points for a length in meters.' },
  play: { html: tag('', child(`src="vase.gsv" ${VASE}`)), said: 'A clip of 10 seconds plays in the room.' },
  pose: {
    html: tag('', child(`src="walker.onnx" ${PERSON}`)),
    said: 'A network draws a person on your GPU. It fetches 10 MB.',
  },
};

/**
 * Connects the chips.
 * @param scene {HTMLElement} the `<gaussian-splat>`
 * @param place {HTMLElement} holds the buttons, the slider of the pose and the status
 * @param show {(html: string) => void} receives the HTML of the chosen chip
 * @returns {{ remove(): void }} ends the chosen chip, and removes all of them
 */
export function chipsOf(scene, place, show) {
  const group = place.querySelector('.chips');
  const buttons = [...group.querySelectorAll('[data-chip]')];
  const status = place.querySelector('[role=status]');
  const [handle, arms] = [place.querySelector('.handle'), place.querySelector('#arms')];
  let chosen = new AbortController();
  const end = () => {
    chosen.abort();
    chosen = new AbortController();
    for (const button of buttons) button.setAttribute('aria-pressed', 'false');
  };
  const actions = {
    walk: (signal) => walk(scene, signal),
    measure: (signal) => measure(scene, signal),
    play: (signal) => addChild(scene, `src="scenes/vase.gsv" ${VASE}`, signal),
    pose: (signal) => pose(scene, handle, arms, signal),
  };
  for (const button of buttons) {
    button.addEventListener('click', async () => {
      const isOff = button.getAttribute('aria-pressed') === 'true';
      end();
      if (isOff) return void (status.textContent = '');
      const { chip } = button.dataset;
      const { signal } = chosen;
      button.setAttribute('aria-pressed', 'true');
      show(CHIPS[chip].html);
      status.textContent = CHIPS[chip].said;
      await actions[chip](signal).catch((error) => signal.aborted || (status.textContent = error.message));
    });
  }
  // WebGL 2 draws one scene.
  scene.addEventListener('load', () => {
    if (scene.stats.renderer === 'webgl')
      for (const name of ['play', 'pose']) group.querySelector(`[data-chip=${name}]`).hidden = true;
  });
  return {
    remove() {
      end();
      group.remove();
    },
  };
}

const next = (target, type, signal) =>
  new Promise((resolve, reject) => {
    target.addEventListener(type, resolve, { once: true, signal });
    signal.addEventListener('abort', () => reject(signal.reason));
  });

/** Waits for the scene and the view of the page, in which the points of the chips are known. */
async function settle(scene) {
  await scene.ready;
  scene.dismissPoster();
  const [orbit, target, fieldOfView] = ['camera-orbit', 'camera-target', 'field-of-view'].map((name) =>
    scene.getAttribute(name),
  );
  await scene.flyTo({ orbit, target, fieldOfView }, { duration: 0 });
}

/** Clicks a point of the scene, as a visitor would. */
function click(scene, [x, y]) {
  const { left, top, width, height } = scene.getBoundingClientRect();
  const at = { clientX: left + width / 2 + x * height, clientY: top + height / 2 + y * height };
  const options = { ...at, bubbles: true, cancelable: true, composed: true };
  const target = scene.shadowRoot.elementFromPoint(at.clientX, at.clientY);
  target?.dispatchEvent(new PointerEvent('pointerdown', options));
  target?.dispatchEvent(new PointerEvent('pointerup', options));
  target?.dispatchEvent(new MouseEvent('click', options));
}

async function walk(scene, signal) {
  signal.addEventListener('abort', () => scene.removeAttribute('navigation'));
  await settle(scene);
  const ready = next(scene, 'walk-ready', signal);
  scene.setAttribute('navigation', 'walk');
  await ready;
  click(scene, TO_DOOR);
}

/** The ruler draws itself along the table. */
async function measure(scene, signal) {
  signal.addEventListener('abort', () => scene.removeAttribute('measure'));
  await settle(scene);
  await scene.flyTo(ABOVE_TABLE);
  signal.throwIfAborted();
  scene.setAttribute('measure', '');
  const button = await found(() => scene.shadowRoot.querySelector('[part=measure-button]'), signal);
  button.click();
  for (const point of TABLE) {
    click(scene, point);
    await new Promise((resolve) => setTimeout(resolve, 400));
  }
}

async function found(find, signal) {
  for (;;) {
    signal.throwIfAborted();
    const element = find();
    if (element) return element;
    await new Promise((resolve) => requestAnimationFrame(resolve));
  }
}

async function addChild(scene, attributes, signal) {
  const template = document.createElement('template');
  template.innerHTML = `<splat-scene ${attributes}></splat-scene>`;
  const added = template.content.firstElementChild;
  signal.addEventListener('abort', () => added.remove());
  await settle(scene);
  scene.append(added);
  await customElements.whenDefined('splat-scene');
  await added.ready;
  return added;
}

async function pose(scene, handle, slider, signal) {
  // The slider appears with the press, so that nothing moves when the person has loaded.
  handle.hidden = false;
  signal.addEventListener('abort', () => (handle.hidden = true));
  const { jointsOf } = await import('./joints.js');
  const joints = await jointsOf(new URL(WALKER, document.baseURI));
  const added = await addChild(scene, `src="${WALKER}" ${PERSON}`, signal);
  const set = () => (added.pose = poseOf(joints, { arms: slider.valueAsNumber, knees: 0, head: 0 }));
  slider.addEventListener('input', set, { signal });
  set();
}
