/** Measures the cost of a scene on the visitor's machine, in the page, while it is drawn. */

const TURN_DEGREES = 6;
/** Upper limit of measured frames; the page's address may set fewer. */
const FRAMES = Number(new URLSearchParams(location.search).get('frames') ?? 30);

/** Fewer frames say little: their median is one of them. */
const ENOUGH = 9;

/**
 * Frame times of scenes that take turns, frame by frame, so that other work on the machine affects all of them. A frame's time goes from its submission until the GPU has finished it. The cameras
 * turn around their scenes and go back in the end. One frame of each is drawn before the first that counts. ONNX Runtime's work on the same device is in the figures.
 * @param elements {HTMLElement[]} `<gaussian-splat>` elements whose scenes are shown; the page scrolls to them, since off-screen elements do not draw.
 * @param options.frames upper limit of the frames of each. @param options.limitMs no further round starts after this time.
 * @returns {Promise<{ median: number, frames: number, isEnough: boolean, width: number, height: number }[]>} of each element; `isEnough` is false below 9 frames.
 */
export async function measureInTurns(elements, { frames = FRAMES, limitMs = 6000 } = {}) {
  elements[0].scrollIntoView({ block: 'nearest' });
  const all = [];
  try {
    for (const element of elements) all.push(await turning(element));
    for (const { step } of all) await step();
    const times = all.map(() => []);
    const started = performance.now();
    while (times[0].length < frames && performance.now() - started < limitMs) {
      for (const [i, { step }] of all.entries()) times[i].push(await step());
    }
    return elements.map((element, i) => {
      const sorted = times[i].sort((a, b) => a - b);
      const { width, height } = element.shadowRoot.querySelector('canvas');
      const count = sorted.length;
      return { median: sorted[count >> 1], frames: count, isEnough: count >= ENOUGH, width, height };
    });
  } finally {
    for (const { end } of all) end();
  }
}

/** {@link measureInTurns} of one scene. */
export const measureFrames = async (element, options) => (await measureInTurns([element], options))[0];

/** A scene whose camera is turned by hand: each `step` draws a frame and gives its milliseconds. */
async function turning(element) {
  const lease = await element.constructor.sharedDevice.acquire();
  const { queue } = lease.device;
  const decay = element.getAttribute('interpolation-decay');
  const { theta, phi, radius } = element.getCameraOrbit();
  let count = 0;
  const turnTo = (steps) => {
    element.setAttribute('camera-orbit', `${theta + (steps * TURN_DEGREES * Math.PI) / 180}rad ${phi}rad ${radius}m`);
    element.jumpCameraToGoal();
  };
  element.setAttribute('interpolation-decay', '0');
  return {
    async step() {
      await queue.onSubmittedWorkDone();
      const moved = nextFrame(element);
      turnTo(++count);
      const submitted = await moved;
      await queue.onSubmittedWorkDone();
      return performance.now() - submitted;
    },
    end() {
      turnTo(0);
      if (decay === null) element.removeAttribute('interpolation-decay');
      else element.setAttribute('interpolation-decay', decay);
      lease.release();
    },
  };
}

/** When the next frame was submitted. */
function nextFrame(element) {
  return new Promise((resolve, reject) => {
    const timer = setTimeout(() => reject(new Error('No frame was drawn: is the scene in the viewport?')), 20_000);
    const finish = () => {
      clearTimeout(timer);
      resolve(performance.now());
    };
    element.addEventListener('camera-change', finish, { once: true });
  });
}

/** Name of the graphics adapter, if the browser reports it. */
export async function adapterName() {
  const { info = {} } = (await navigator.gpu?.requestAdapter()) ?? {};
  return [info.vendor, info.architecture, info.description].filter(Boolean).join(' ') || 'an adapter without a name';
}

/**
 * Reports the time until a scene's first frame, once it is drawn: from the start of loading, so that the network, the shaders and,
 * of a generator, the runtime and the first run are in it.
 * @param element {HTMLElement}
 * @param tell {(milliseconds: number) => void} called for every load.
 */
export function timeLoading(element, report) {
  let started = performance.now();
  element.addEventListener('loadstart', () => (started = performance.now()));
  element.addEventListener('load', () => report(performance.now() - started));
}
