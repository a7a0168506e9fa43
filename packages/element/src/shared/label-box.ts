import type { Camera } from '@gaussian-splat/core';
import type { ViewerFrame } from '../viewer/camera/orbit.js';

type Point = readonly [x: number, y: number, z: number];

/** A label at a point of viewer space, and its position in the last frame. */
export interface Located {
  readonly position: Point | null;
  /** Normal of the label's surface in viewer space; null for a label that faces every camera. */
  readonly normal: Point | null;
  /** Position in CSS pixels from the left and the top edge of the element. */
  x: number;
  y: number;
  /** Depth along the optical axis, world units; 0 for a point nearer than the near plane, and without a position. */
  depth: number;
  facesCamera: boolean;
}

/** Projects points of viewer space with the camera of one frame. All labels of the frame share the matrix. */
export class LabelView {
  readonly #camera: Camera;
  /** Row-major 3x4 matrix from viewer space to camera coordinates. */
  readonly #matrix: readonly number[];
  readonly #scaleX: number;
  readonly #scaleY: number;

  /**
   * @param frame Rotation from scene coordinates to viewer space.
   * @param width Width of the element, CSS pixels.
   * @param height Height of the element, CSS pixels.
   */
  constructor(camera: Camera, frame: ViewerFrame, width: number, height: number) {
    const m = camera.worldToCamera;
    this.#camera = camera;
    this.#matrix = [0, 4, 8].flatMap((row) => [
      ...frame.map(([x, y, z]) => m[row] * x + m[row + 1] * y + m[row + 2] * z),
      m[row + 3],
    ]);
    this.#scaleX = width / camera.width;
    this.#scaleY = height / camera.height;
  }

  /** Writes `x`, `y`, `depth` and `facesCamera` of a label. A label without a position gets only the depth 0. */
  locate(label: Located): void {
    const { position, normal } = label;
    label.depth = 0;
    if (position === null) return;
    const { fx, fy, cx, cy, near, orthographic } = this.#camera;
    const [x, y, z] = [this.#along(0, position, 1), this.#along(4, position, 1), this.#along(8, position, 1)];
    const shrink = orthographic ? 1 : z;
    label.x = ((fx * x) / shrink + cx) * this.#scaleX;
    label.y = ((fy * y) / shrink + cy) * this.#scaleY;
    label.depth = z > near ? z : 0;
    label.facesCamera = normal === null || this.#toward(normal, orthographic ? [0, 0, 1] : [x, y, z]) < 0;
  }

  /**
   * Returns the dot product of a normal and the direction of the ray through a point, in camera coordinates: negative
   * if the surface faces the camera. The eye is their origin, so a ray of perspective has the direction of its point.
   */
  #toward(normal: Point, [x, y, z]: Point): number {
    return this.#along(0, normal, 0) * x + this.#along(4, normal, 0) * y + this.#along(8, normal, 0) * z;
  }

  #along(row: number, [x, y, z]: Point, w: number): number {
    const m = this.#matrix;
    return m[row] * x + m[row + 1] * y + m[row + 2] * z + m[row + 3] * w;
  }
}

/**
 * The box of a label in the element's shadow tree. The styles of the box are written only for visible changes, because
 * each write causes a style recalculation.
 */
export class LabelBox {
  readonly #element: HTMLElement;
  #x = NaN;
  #y = NaN;
  #classes = '';
  #isPlaced = false;

  constructor(element: HTMLElement) {
    this.#element = element;
  }

  /**
   * Places the box at a position. Does not write styles if the box moves by less than `min` CSS pixels in x and in y.
   */
  moveTo({ x, y }: Located, min: number): void {
    this.#isPlaced = true;
    if (Math.abs(x - this.#x) < min && Math.abs(y - this.#y) < min) return;
    this.#x = x;
    this.#y = y;
    this.#element.style.transform = `translate(${x.toFixed(2)}px, ${y.toFixed(2)}px) translate(-50%, -50%)`;
  }

  /** Marks the label as outside the frame; the next call of {@link show} hides its box. */
  remove(): void {
    this.#isPlaced = false;
  }

  /**
   * Writes the classes that show, fade or hide the box.
   * @param isOpen Whether the label faces the camera and is not occluded.
   * @param holdsPanel Whether an open panel keeps a faded label usable.
   */
  show(isOpen: boolean, holdsPanel: boolean): void {
    const classes = `hotspot${this.#isPlaced ? ' placed' : ''}${isOpen ? '' : holdsPanel ? ' hidden with-panel' : ' hidden'}`;
    if (classes === this.#classes) return;
    this.#classes = classes;
    this.#element.className = classes;
  }
}
