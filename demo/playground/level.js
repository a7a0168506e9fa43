/** A capture that is tilted, set upright by three points of its floor: the value of the attribute `up`. */
import { parseUp } from '../../packages/element/dist/viewer/camera/grammar.js';
import { eyeOfPose, toScene, viewerFrame } from '../../packages/element/dist/viewer/camera/orbit.js';
import { pickPoint } from './pick.js';

/** The default up direction of a scene. */
const AS_TRAINED = [0, -1, 0];

const difference = (a, b) => [a.x - b.x, a.y - b.y, a.z - b.z];
const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];

/**
 * Upright of the plane through three points of viewer space, on the side of the eye.
 * @returns {number[] | null} of length 1; null if the points are nearly in a line.
 */
export function uprightOf([a, b, c], eye) {
  const [first, second] = [difference(b, a), difference(c, a)];
  const normal = cross(first, second);
  const length = Math.hypot(...normal);
  if (!(length > 0.02 * Math.hypot(...first) * Math.hypot(...second))) return null;
  const side = Math.sign(dot(normal, difference(eye, a))) || 1;
  return normal.map((value) => (side * value) / length);
}

/** The current up direction: from the attribute, which a cropped scene has on its own tag, or else from the file. */
export const upNow = (scene) =>
  parseUp((scene.querySelector('splat-scene') ?? scene).getAttribute('up') ?? '') ?? scene.stats?.up ?? AS_TRAINED;

/** A value for `up` that turns a scene on its head. */
export function turnedOver(scene) {
  const numbers = upNow(scene).map((value) => Number((-value).toFixed(4)));
  const axis = numbers.findIndex((value) => Math.abs(value) === 1);
  return axis < 0 ? numbers.join(' ') : `${numbers[axis] < 0 ? '-' : ''}${'xyz'[axis]}`;
}

/** The value of `up` that makes a direction of viewer space point up. */
function upOf(direction, scene) {
  const frame = viewerFrame(upNow(scene));
  return toScene(frame, direction)
    .map((value) => Number(value.toFixed(4)))
    .join(' ');
}

/**
 * Asks a visitor for three points of the floor.
 * @param scene {HTMLElement} a `<gaussian-splat>` whose scene is shown
 * @param say {(sentence: string) => void}
 * @param signal {AbortSignal} ends it
 * @returns {Promise<string>} a value for `up`; rejects if `signal` is aborted.
 */
export async function askForLevel(scene, say, signal) {
  const points = [];
  const clear = () => scene.querySelectorAll('[slot^="hotspot-level"]').forEach((mark) => mark.remove());
  signal.addEventListener('abort', clear, { once: true });
  say('Click three points of the floor, or of a table, far from one another. Drags turn the scene as before.');
  for (;;) {
    const point = await pickPoint(scene, signal);
    signal.throwIfAborted();
    if (point === null) {
      say('There is nothing of the scene at this point. Choose another point.');
      continue;
    }
    points.push(point);
    scene.append(markAt(point, points.length));
    if (points.length < 3) {
      say(points.length === 1 ? 'Two more.' : 'One more.');
      continue;
    }
    const { theta, phi, radius } = scene.getCameraOrbit();
    const [x, y, z] = eyeOfPose({ theta, phi, radius, ...scene.getCameraTarget() });
    const upright = uprightOf(points, { x, y, z });
    clear();
    if (upright !== null) return upOf(upright, scene);
    points.length = 0;
    say('These three are nearly in a line. Three others?');
  }
}

function markAt(point, number) {
  const mark = document.createElement('span');
  mark.slot = `hotspot-level-${number}`;
  mark.className = 'mark';
  mark.dataset.position = String(point);
  mark.textContent = number;
  return mark;
}
