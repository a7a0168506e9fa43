/** What a scene costs here: measured on the visitor's machine, in the page, while it is drawn. */

const TURN_DEGREES = 6;
/** Most frames that are measured; the page's address may say fewer. */
const FRAMES = Number(new URLSearchParams(location.search).get('frames') ?? 30);

/**
 * Milliseconds from the submission of a frame until the GPU has finished it: the camera is turned around the scene, frame by
 * frame, and goes back to where it was. ONNX Runtime's work on the same device is in the figure.
 * @param element {HTMLElement} a `<gaussian-splat>` whose scene is on show; it is brought into sight, since nothing is drawn elsewhere.
 * @param options.frames most frames. @param options.limitMs no further frame is begun after this time.
 * @returns {Promise<{ median: number, frames: number, width: number, height: number }>}
 */
export async function measureFrames(element, { frames = FRAMES, limitMs = 6000 } = {}) {
  element.scrollIntoView({ block: 'nearest' });
  const lease = await element.constructor.sharedDevice.acquire();
  const { queue } = lease.device;
  const decay = element.getAttribute('interpolation-decay');
  const { theta, phi, radius } = element.getCameraOrbit();
  const turnTo = (step) => `${theta + (step * TURN_DEGREES * Math.PI) / 180}rad ${phi}rad ${radius}m`;
  const times = [];
  try {
    element.setAttribute('interpolation-decay', '0');
    const started = performance.now();
    while (times.length < frames && performance.now() - started < limitMs) {
      await queue.onSubmittedWorkDone();
      const moved = nextFrame(element);
      element.setAttribute('camera-orbit', turnTo(times.length + 1));
      element.jumpCameraToGoal();
      const submitted = await moved;
      await queue.onSubmittedWorkDone();
      times.push(performance.now() - submitted);
    }
  } finally {
    element.setAttribute('camera-orbit', turnTo(0));
    element.jumpCameraToGoal();
    if (decay === null) element.removeAttribute('interpolation-decay');
    else element.setAttribute('interpolation-decay', decay);
    lease.release();
  }
  times.sort((a, b) => a - b);
  const { width, height } = element.shadowRoot.querySelector('canvas');
  return { median: times[times.length >> 1], frames: times.length, width, height };
}

/** When the next frame was submitted. */
function nextFrame(element) {
  return new Promise((resolve, reject) => {
    const timer = setTimeout(() => reject(new Error('No frame came: is the scene in sight?')), 20_000);
    const finish = () => {
      clearTimeout(timer);
      resolve(performance.now());
    };
    element.addEventListener('camera-change', finish, { once: true });
  });
}

/** Name of the graphics adapter, as far as the browser tells it. */
export async function adapterName() {
  const { info = {} } = (await navigator.gpu?.requestAdapter()) ?? {};
  return [info.vendor, info.architecture, info.description].filter(Boolean).join(' ') || 'an adapter without a name';
}

/**
 * Tells how long a scene takes until its first picture, once it is there: from the begin of loading, so that the network, the shaders and,
 * of a generator, the runtime and the first run are in it.
 * @param element {HTMLElement}
 * @param tell {(milliseconds: number) => void} called for every load.
 */
export function timeLoading(element, tell) {
  let started = performance.now();
  element.addEventListener('loadstart', () => (started = performance.now()));
  element.addEventListener('load', () => tell(performance.now() - started));
}
