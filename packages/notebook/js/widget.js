/**
 * The view of `Splats` in a page: a `<gaussian-splat>`. The kernel sends the code of the element once for a page, so that
 * it is neither downloaded nor part of each widget's state.
 */

/** Promise of the element's code, which all widgets of a page share. */
const CODE = Symbol.for('gaussian-splat-notebook');
/** Distance between press and release, CSS pixels, from which a movement is a drag and no click. */
const DRAG = 5;
/** Delay after which a moved camera is reported, ms. */
const REPORT_MS = 100;
/** Traits of the camera: their attributes, and the element's methods that return current values. */
const CAMERA = {
  camera_orbit: ['camera-orbit', 'getCameraOrbit'],
  camera_target: ['camera-target', 'getCameraTarget'],
  field_of_view: ['field-of-view', 'getFieldOfView'],
};

function loadElement(model) {
  globalThis[CODE] ??= customElements.get('gaussian-splat')
    ? Promise.resolve()
    : new Promise((resolve, reject) => {
        const onMessage = ({ type }, [code]) => {
          if (type !== 'element') return;
          model.off('msg:custom', onMessage);
          const url = URL.createObjectURL(new Blob([code], { type: 'text/javascript' }));
          import(/* @vite-ignore */ url).then(resolve, reject).finally(() => URL.revokeObjectURL(url));
        };
        model.on('msg:custom', onMessage);
        model.send({ type: 'element' });
      });
  return globalThis[CODE];
}

/** Passes updates of the kernel to the element as a WebSocket does, and the numbers of shown ones to the kernel. */
class Channel extends EventTarget {
  readyState = WebSocket.OPEN;
  url = 'the kernel';
  #model;
  #isFollowed = false;
  /** The newest scene that has arrived before the element listens. */
  #waiting;

  constructor(model) {
    super();
    this.#model = model;
  }

  send(word) {
    if (word !== 'ready') return this.#model.send({ type: 'shown', step: Number(word) });
    // The element listens, perhaps again: then the kernel has the newest scene.
    this.#isFollowed = true;
    const waiting = this.#waiting;
    this.#waiting = undefined;
    if (waiting) this.post(waiting);
    else this.#model.send({ type: 'scene' });
  }

  post(data) {
    const isRange = (new Uint8Array(data)[5] & 1) !== 0;
    if (this.#isFollowed) this.dispatchEvent(new MessageEvent('message', { data }));
    else if (!isRange) this.#waiting = data;
  }
}

/** Copies the bytes of a message to a buffer of their own. */
const bytesOf = ({ buffer, byteOffset, byteLength }) => buffer.slice(byteOffset, byteOffset + byteLength);

async function render({ model, el }) {
  await loadElement(model);
  const view = document.createElement('gaussian-splat');
  const listening = new AbortController();
  const { signal } = listening;
  const channel = new Channel(model);
  /** Calls a function now, and after each change of a trait. */
  const observe = (name, apply) => {
    model.on(`change:${name}`, apply);
    signal.addEventListener('abort', () => model.off(`change:${name}`, apply));
    apply();
  };
  const setAttribute = (name, value) =>
    value === null || value === undefined ? view.removeAttribute(name) : view.setAttribute(name, value);
  const save = (values) => {
    for (const [name, value] of Object.entries(values)) model.set(name, value);
    model.save_changes();
  };

  view.style.cssText = 'display: block; width: 100%';
  view.setAttribute('camera-controls', '');
  view.setAttribute('alt', 'Gaussian splats');
  observe('height', () => (view.style.height = model.get('height')));
  let written = [];
  observe('attributes', () => {
    const attributes = model.get('attributes');
    for (const name of written) if (!(name in attributes)) view.removeAttribute(name);
    written = Object.keys(attributes);
    for (const [name, value] of Object.entries(attributes)) setAttribute(name, value);
  });
  observe('src', () => setAttribute('src', model.get('src')));

  // Values that the view itself has reported, which must not move its camera.
  const reported = {};
  for (const [trait, [attribute]] of Object.entries(CAMERA))
    observe(trait, () => {
      const value = model.get(trait);
      if (value !== reported[trait]) setAttribute(attribute, value);
    });
  let timer;
  view.addEventListener('camera-change', ({ detail }) => {
    if (detail?.source && detail.source !== 'user-interaction') return;
    clearTimeout(timer);
    timer = setTimeout(() => {
      for (const [trait, [, method]] of Object.entries(CAMERA)) reported[trait] = String(view[method]());
      save(reported);
    }, REPORT_MS);
  });

  let pressed;
  view.addEventListener('pointerdown', ({ clientX, clientY }) => (pressed = [clientX, clientY]), { capture: true });
  view.addEventListener('click', async ({ clientX, clientY }) => {
    if (!pressed || Math.hypot(clientX - pressed[0], clientY - pressed[1]) > DRAG) return;
    const found = await view.positionFromPoint(clientX, clientY);
    const { x, y, z, uncertainty, distance, splat } = found ?? {};
    save({ pick: found && { position: [x, y, z], uncertainty, distance, splat } });
  });
  observe('markers', () => {
    for (const old of view.querySelectorAll(':scope > [slot^=hotspot-]')) old.remove();
    model.get('markers').forEach((position, k) => {
      const marker = Object.assign(document.createElement('span'), { slot: `hotspot-marker-${k}`, textContent: k + 1 });
      marker.dataset.position = position.map((value) => `${value}m`).join(' ');
      marker.style.cssText =
        'font: 12px/1.5 sans-serif; padding: 0 0.5em; border-radius: 1em; color: white; background: rgb(0 0 0 / 0.7)';
      view.append(marker);
    });
  });

  view.addEventListener('loadstart', () => save({ state: 'loading', error: '' }));
  view.addEventListener('load', () => save({ state: 'ready', error: '' }));
  view.addEventListener('error', ({ detail }) => save({ state: 'failed', error: detail.message }));
  view.addEventListener('generator-error', ({ detail }) => save({ error: detail.message }));
  const onMessage = ({ type, name }, buffers) => {
    if (type === 'file') view.src = new File([bytesOf(buffers[0])], name);
    if (type !== 'update') return;
    if (view.splats !== channel) view.splats = channel;
    channel.post(bytesOf(buffers[0]));
  };
  model.on('msg:custom', onMessage);
  signal.addEventListener('abort', () => model.off('msg:custom', onMessage));
  el.append(view);
  model.send({ type: 'scene' });
  return () => {
    listening.abort();
    clearTimeout(timer);
    view.remove();
  };
}

export default { render };
