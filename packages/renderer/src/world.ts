import { GaussianSplatError, type Ball, type Bounds, type Matrix4, type Vector3 } from '@gaussian-splat/core';
import type { GaussianScene } from './gaussian-scene.js';

/** An axis-aligned box. */
export interface Box {
  readonly min: Vector3;
  readonly max: Vector3;
}

/** How a scene stands in a {@link World}. */
export interface Placed {
  readonly scene: GaussianScene;
  /** Scene to world, row-major 4x4, last row (0, 0, 0, 1), float64: any affine matrix that can be inverted. Default: the identity. */
  readonly sceneToWorld?: Matrix4 | undefined;
  /** Factor of the opacity of each splat, 0 to 1. Default: 1. */
  readonly opacity?: number | undefined;
  /** Only splats whose centres lie in this box, in the scene's own frame, are drawn. */
  readonly crop?: Box | undefined;
  /** Default: true. */
  readonly visible?: boolean | undefined;
  /** Bounds in the scene's own frame, for {@link World.bounds}. */
  readonly bounds?: Bounds | undefined;
}

/** A scene in a {@link World}. What is set here holds from the next frame on. */
export class Placement implements Placed {
  readonly scene: GaussianScene;
  /** @internal Called where a frame of the placement would differ; with true where the list of visible scenes does. */
  readonly #onChange: (ofList: boolean) => void;
  #sceneToWorld: Matrix4 | undefined;
  #opacity = 1;
  #crop: Box | undefined;
  #visible: boolean;
  /** Bounds in the scene's own frame, for {@link World.bounds}. */
  bounds: Bounds | undefined;

  /** Made by {@link World.add}. */
  constructor(placed: Placed, onChange: (ofList: boolean) => void) {
    this.#onChange = () => undefined;
    this.scene = placed.scene;
    this.bounds = placed.bounds;
    this.sceneToWorld = placed.sceneToWorld;
    this.opacity = placed.opacity ?? 1;
    this.crop = placed.crop;
    this.#visible = placed.visible ?? true;
    this.#onChange = onChange;
  }

  /**
   * Scene to world; undefined where they are the same. The matrix is copied.
   * @throws GaussianSplatError `argument/value` for one that is not affine, not finite or cannot be inverted.
   */
  get sceneToWorld(): Matrix4 | undefined {
    return this.#sceneToWorld;
  }

  set sceneToWorld(matrix: Matrix4 | undefined) {
    if (matrix) requireAffine(matrix);
    const before = this.#sceneToWorld;
    if (before === matrix || (matrix && before?.every((value, k) => value === matrix[k]))) return;
    this.#sceneToWorld = matrix && Float64Array.from(matrix);
    this.#onChange(false);
  }

  /** @throws GaussianSplatError `argument/value` for a number below 0 or above 1. */
  get opacity(): number {
    return this.#opacity;
  }

  set opacity(opacity: number) {
    if (!(opacity >= 0 && opacity <= 1)) throw wrong('opacity', 'a number from 0 to 1', opacity);
    if (opacity === this.#opacity) return;
    this.#opacity = opacity;
    this.#onChange(false);
  }

  /** @throws GaussianSplatError `argument/value` for corners that are not three numbers each. */
  get crop(): Box | undefined {
    return this.#crop;
  }

  set crop(crop: Box | undefined) {
    const isBox = crop === undefined || [crop.min, crop.max].every((p) => p?.length === 3 && !p.some(Number.isNaN));
    if (!isBox) throw wrong('crop', '{ min, max } of three numbers each', JSON.stringify(crop));
    if (crop === this.#crop) return;
    this.#crop = crop;
    this.#onChange(false);
  }

  get visible(): boolean {
    return this.#visible;
  }

  set visible(visible: boolean) {
    if (visible === this.#visible) return;
    this.#visible = visible;
    this.#onChange(true);
  }
}

/**
 * Scenes that are drawn together: sorted once, so that they hide one another. Any number of {@link Viewpoint}s may draw one world.
 *
 * ```ts
 * const world = new World();
 * const room = world.add({ scene: roomGaussians });
 * const plant = world.add({ scene: plantGaussians, sceneToWorld: [1, 0, 0, 1.2, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1] });
 * plant.opacity = 0.8;
 * ```
 *
 * A world holds no memory of its own: scenes belong to those who made them, and must live as long as they are in it.
 */
export class World {
  #placements: readonly Placement[] = [];
  #layout = 0;
  #changes = 0;

  /** All scenes, visible or not, in the order in which they were added: it decides between equal depths. */
  get placements(): readonly Placement[] {
    return this.#placements;
  }

  /** Grows when scenes are added, removed, shown or hidden. */
  get layout(): number {
    return this.#layout;
  }

  /** Grows when a scene is placed otherwise than before. */
  get changes(): number {
    return this.#changes;
  }

  /**
   * Adds a scene. The same scene may stand in several places.
   * @throws GaussianSplatError `argument/value` for a placement out of range.
   */
  add(placed: Placed): Placement {
    if (typeof placed?.scene !== 'object' || !Array.isArray(placed.scene?.pages))
      throw wrong('scene', 'a GaussianScene: GaussianBuffers, DynamicGaussians, …', placed?.scene);
    const placement = new Placement(placed, (ofList) => {
      // One that was removed changes nothing.
      if (!this.#placements.includes(placement)) return;
      if (ofList) this.#layout++;
      else this.#changes++;
    });
    this.#placements = [...this.#placements, placement];
    this.#layout++;
    return placement;
  }

  /** Takes a scene out. Its memory stays: it belongs to whoever made it. */
  remove(placement: Placement): void {
    const left = this.#placements.filter((other) => other !== placement);
    if (left.length === this.#placements.length) return;
    this.#placements = left;
    this.#layout++;
  }

  /** Where the visible scenes are, in world units, of those whose bounds are known; undefined where none is. */
  bounds(): Bounds | undefined {
    const all = this.#placements.flatMap((placement) => {
      const { bounds, visible } = placement;
      return bounds && visible ? [placedBounds(bounds, placement)] : [];
    });
    return all.length > 0 ? all.reduce(union) : undefined;
  }
}

/** Where a point of a scene stands in the world. */
export function inWorld(m: Matrix4 | undefined, [x, y, z]: Vector3): Vector3 {
  if (m === undefined) return [x, y, z];
  const row = (r: number): number => m[r] * x + m[r + 1] * y + m[r + 2] * z + m[r + 3];
  return [row(0), row(4), row(8)];
}

function placedBounds(bounds: Bounds, { sceneToWorld: m, crop }: Placed): Bounds {
  const cropped = crop ? cut(bounds, crop) : bounds;
  if (m === undefined) return cropped;
  const corners = [0, 1, 2, 3, 4, 5, 6, 7].map((k) => {
    const side = (axis: number): number => ((k >> axis) & 1 ? cropped.max : cropped.min)[axis];
    return inWorld(m, [side(0), side(1), side(2)]);
  });
  const of = (choose: (...values: number[]) => number): Vector3 => {
    const at = (axis: number): number => choose(...corners.map((corner) => corner[axis]));
    return [at(0), at(1), at(2)];
  };
  const stretch = Math.max(...[0, 1, 2].map((column) => Math.hypot(m[column], m[4 + column], m[8 + column])));
  const { subject } = cropped;
  const ball = ({ center, radius }: Ball): Ball => ({ center: inWorld(m, center), radius: radius * stretch });
  return { min: of(Math.min), max: of(Math.max), ...ball(cropped), ...(subject && { subject: ball(subject) }) };
}

/** Bounds of what a crop leaves. */
function cut(bounds: Bounds, crop: Box): Bounds {
  const clamp = (p: Vector3): Vector3 => {
    const at = (axis: number): number => Math.min(crop.max[axis], Math.max(crop.min[axis], p[axis]));
    return [at(0), at(1), at(2)];
  };
  const [min, max] = [clamp(bounds.min), clamp(bounds.max)];
  const reach = Math.hypot(max[0] - min[0], max[1] - min[1], max[2] - min[2]) / 2;
  const { center, radius } = bounds;
  return { min, max, center: clamp(center), radius: Math.min(radius, reach) || radius };
}

/** Bounds of two scenes together. */
function union(a: Bounds, b: Bounds): Bounds {
  const pick = (choose: (x: number, y: number) => number, p: Vector3, q: Vector3): Vector3 => [
    choose(p[0], q[0]),
    choose(p[1], q[1]),
    choose(p[2], q[2]),
  ];
  const boxes = { min: pick(Math.min, a.min, b.min), max: pick(Math.max, a.max, b.max) };
  const subject = a.subject && b.subject && joined(a.subject, b.subject);
  return { ...boxes, ...joined(a, b), ...(subject && { subject }) };
}

/** The least ball around two. */
function joined(a: Ball, b: Ball): Ball {
  const [dx, dy, dz] = [0, 1, 2].map((axis) => b.center[axis] - a.center[axis]);
  const distance = Math.hypot(dx, dy, dz);
  if (distance + b.radius <= a.radius) return { center: a.center, radius: a.radius };
  if (distance + a.radius <= b.radius) return { center: b.center, radius: b.radius };
  const radius = (distance + a.radius + b.radius) / 2;
  const t = (radius - a.radius) / distance;
  return { center: [a.center[0] + t * dx, a.center[1] + t * dy, a.center[2] + t * dz], radius };
}

function requireAffine(m: Matrix4): void {
  const isAffine =
    m.length === 16 && m.every(Number.isFinite) && m[12] === 0 && m[13] === 0 && m[14] === 0 && m[15] === 1;
  const determinant = isAffine
    ? m[0] * (m[5] * m[10] - m[6] * m[9]) - m[1] * (m[4] * m[10] - m[6] * m[8]) + m[2] * (m[4] * m[9] - m[5] * m[8])
    : NaN;
  if (Number.isFinite(1 / determinant)) return;
  throw wrong(
    'sceneToWorld',
    '16 finite numbers, row-major, last row 0, 0, 0, 1, of a matrix that can be inverted',
    `[${Array.from(m).join(', ')}]`,
  );
}

function wrong(name: keyof Placed, expected: string, found: unknown): GaussianSplatError {
  return new GaussianSplatError('argument/value', {
    where: `Placement.${name}`,
    expected,
    found: String(found),
    remedy: `see Placed.${name}`,
  });
}
