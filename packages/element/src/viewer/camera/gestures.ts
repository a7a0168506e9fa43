/** Maps pointers, wheel and keys to camera actions, from positions and key names, without the DOM. */

/**
 * Effect of a gesture. `theta` and `phi` are radians, `factor` multiplies the distance to the target, and `right` and
 * `up` are fractions of the frame's height.
 */
export type CameraAction =
  | { readonly type: 'orbit'; readonly theta: number; readonly phi: number }
  | { readonly type: 'zoom'; readonly factor: number }
  | { readonly type: 'pan'; readonly right: number; readonly up: number }
  | { readonly type: 'reset' };

/** A point in CSS pixels. */
export interface Point {
  readonly x: number;
  readonly y: number;
}

const KEY_ANGLE = Math.PI / 8;
const KEY_ZOOM = 1.2;
const KEY_PAN = 0.1;
/** Wheel movement in pixels that changes the distance by a factor of e. */
const WHEEL_PIXELS = 500;
/** Gain for a pinch on a touchpad, which browsers report as a wheel event with Ctrl in much smaller steps. */
const PINCH_GAIN = 5;
/** CSS pixels per unit of WheelEvent's `deltaMode`: pixel, line, page. */
const WHEEL_UNIT_PIXELS = [1, 18, 400];
/** Maximum movement of one wheel event, pixels, because some mice report jumps. */
const MAX_WHEEL_PIXELS = 200;

/** Returns the rotation for a drag between two points: a full turn per frame height. All lengths in CSS pixels. */
export function orbitOf(from: Point, to: Point, height: number): CameraAction {
  const turn = (2 * Math.PI) / height;
  return { type: 'orbit', theta: -(to.x - from.x) * turn, phi: -(to.y - from.y) * turn };
}

/**
 * Returns the pan for a drag between two points, CSS pixels. The camera moves against the drag, so that the target
 * stays under the pointer.
 */
export function panOf(from: Point, to: Point, height: number): CameraAction {
  return { type: 'pan', right: -(to.x - from.x) / height, up: (to.y - from.y) / height };
}

/** Minimum movement of one finger, CSS pixels, from which its direction is determined. */
export const TOUCH_SLOP = 4;

/**
 * Whether a one-finger drag moves the camera, according to the CSS `touch-action` of the frame and the initial
 * direction. The browser decides about scrolling by the same rule, but reports its decision only after the first moves.
 */
export function isCameraDrag(touchAction: string, from: Point, to: Point): boolean {
  const isHorizontal = Math.abs(to.x - from.x) >= Math.abs(to.y - from.y);
  return (
    touchAction === 'none' || (touchAction === 'pan-y' && isHorizontal) || (touchAction === 'pan-x' && !isHorizontal)
  );
}

/**
 * Returns a pan by the movement of the midpoint of two fingers, and a zoom at the target by the change of their
 * distance.
 */
export function pinchOf(from: readonly [Point, Point], to: readonly [Point, Point], height: number): CameraAction[] {
  const [before, after] = [distance(from), distance(to)];
  const pan = panOf(middle(from), middle(to), height);
  return before > 0 && after > 0 ? [pan, { type: 'zoom', factor: before / after }] : [pan];
}

/** Returns the zoom for a wheel event. Scrolling down moves the camera away from the target. */
export function wheelOf(event: { deltaY: number; deltaMode: number; ctrlKey: boolean }): CameraAction {
  const pixels = event.deltaY * (WHEEL_UNIT_PIXELS[event.deltaMode] ?? 1) * (event.ctrlKey ? PINCH_GAIN : 1);
  const bounded = Math.min(MAX_WHEEL_PIXELS, Math.max(-MAX_WHEEL_PIXELS, pixels));
  return { type: 'zoom', factor: Math.exp(bounded / WHEEL_PIXELS) };
}

/**
 * Returns the action of a key, named as in KeyboardEvent.key; null if it has none. Arrow keys move the camera in their
 * direction.
 */
export function keyOf(key: string, shift: boolean): CameraAction | null {
  switch (key) {
    case 'ArrowLeft':
      return shift ? { type: 'pan', right: -KEY_PAN, up: 0 } : { type: 'orbit', theta: -KEY_ANGLE, phi: 0 };
    case 'ArrowRight':
      return shift ? { type: 'pan', right: KEY_PAN, up: 0 } : { type: 'orbit', theta: KEY_ANGLE, phi: 0 };
    case 'ArrowUp':
      return shift ? { type: 'pan', right: 0, up: KEY_PAN } : { type: 'orbit', theta: 0, phi: -KEY_ANGLE };
    case 'ArrowDown':
      return shift ? { type: 'pan', right: 0, up: -KEY_PAN } : { type: 'orbit', theta: 0, phi: KEY_ANGLE };
    case 'PageUp':
    case '+':
    case '=':
      return { type: 'zoom', factor: 1 / KEY_ZOOM };
    case 'PageDown':
    case '-':
    case '_':
      return { type: 'zoom', factor: KEY_ZOOM };
    case 'Home':
      return { type: 'reset' };
    default:
      return null;
  }
}

const distance = ([a, b]: readonly [Point, Point]): number => Math.hypot(a.x - b.x, a.y - b.y);
const middle = ([a, b]: readonly [Point, Point]): Point => ({ x: (a.x + b.x) / 2, y: (a.y + b.y) / 2 });
