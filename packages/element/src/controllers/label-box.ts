import type { Camera } from '@gaussian-splat/core';
import type { ViewerFrame } from '../camera/orbit.js';

type Point = readonly [x: number, y: number, z: number];

/** A point of viewer space, and its position in a frame. */
export interface Located {
  readonly position: Point | null;
  /** Normal of the label's surface; null for a label that faces every camera. */
  readonly normal: Point | null;
  /** CSS pixels from the left and the top edge of the element. */
  x: number;
  y: number;
  /** World units along the optical axis; 0 in front of the near plane, or without a position. */
  depth: number;
  facesCamera: boolean;
}

/** The camera of a frame for points of viewer space: one matrix for all labels of the frame. */
export class LabelView {
  readonly #camera: Camera;
  /** From viewer space to the camera's axes: 3 rows of 4. */
  readonly #matrix: readonly number[];
  readonly #scaleX: number;
  readonly #scaleY: number;

  /**
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

  /** Computes the position of a label. */
  locate(label: Located): void {
    const { position, normal } = label;
    label.depth = 0;
    if (position === null) return;
    const { fx, fy, cx, cy, near } = this.#camera;
    const [x, y, z] = [this.#along(0, position, 1), this.#along(4, position, 1), this.#along(8, position, 1)];
    label.x = ((fx * x) / z + cx) * this.#scaleX;
    label.y = ((fy * y) / z + cy) * this.#scaleY;
    label.depth = z > near ? z : 0;
    label.facesCamera = normal === null || this.#toward(normal, x, y, z) < 0;
  }

  /** The eye is the origin of the camera's axes, so the vector from the eye to a point is the point itself. */
  #toward(normal: Point, x: number, y: number, z: number): number {
    return this.#along(0, normal, 0) * x + this.#along(4, normal, 0) * y + this.#along(8, normal, 0) * z;
  }

  #along(row: number, [x, y, z]: Point, w: number): number {
    const m = this.#matrix;
    return m[row] * x + m[row + 1] * y + m[row + 2] * z + m[row + 3] * w;
  }
}

/**
 * The box of a label in the element's shadow tree. It is written only for visible changes, because each write causes a
 * style recalculation.
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

  /** @param least Minimum visible distance, CSS pixels. */
  moveTo({ x, y }: Located, min: number): void {
    this.#isPlaced = true;
    if (Math.abs(x - this.#x) < min && Math.abs(y - this.#y) < min) return;
    this.#x = x;
    this.#y = y;
    this.#element.style.transform = `translate(${x.toFixed(2)}px, ${y.toFixed(2)}px) translate(-50%, -50%)`;
  }

  /** Hides the label, which is outside the frame. */
  remove(): void {
    this.#isPlaced = false;
  }

  /** @param holdsPanel Whether an open panel keeps a hidden label usable. */
  show(isOpen: boolean, holdsPanel: boolean): void {
    const classes = `hotspot${this.#isPlaced ? ' placed' : ''}${isOpen ? '' : holdsPanel ? ' hidden with-panel' : ' hidden'}`;
    if (classes === this.#classes) return;
    this.#classes = classes;
    this.#element.className = classes;
  }
}
