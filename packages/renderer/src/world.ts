import { GaussianSplatError, linearDeterminant, type Bounds, type Matrix4, type Vector3 } from '@gaussian-splat/core';
import type { GaussianScene } from './gaussian-scene.js';
import type { PlacementModifier } from './placement-modifier.js';

/** An axis-aligned box. */
export interface Box {
  readonly min: Vector3;
  readonly max: Vector3;
}

/** Options of a scene in a {@link World}. */
export interface Placed {
  readonly scene: GaussianScene;
  /**
   * Matrix from scene to world coordinates: row-major 4x4, float64, last row (0, 0, 0, 1). Any invertible affine
   * matrix. Default: the identity.
   */
  readonly sceneToWorld?: Matrix4 | undefined;
  /**
   * Opacity of the scene, 0 to 1: an opaque surface of the scene gets this opacity, as in CSS. Several surfaces behind
   * each other hide more. Default: 1.
   */
  readonly opacity?: number | undefined;
  /** Box in the scene's own coordinates. Only splats whose centers are in it are drawn. Default: no crop. */
  readonly crop?: Box | undefined;
  /** Whether the scene is drawn. Default: true. */
  readonly visible?: boolean | undefined;
  /** Cuts, tints, reveals or moves splats of the scene: a `SplatModifier` of `@gaussian-splat/renderer/modifiers`. */
  readonly modifier?: PlacementModifier | undefined;
  /** Bounds in the scene's own coordinates, for {@link boundsOfWorld}. Default: unknown. */
  readonly bounds?: Bounds | undefined;
}

/** A scene in a {@link World}. Changes apply to the next frame. */
export class Placement implements Placed {
  readonly scene: GaussianScene;
  /**
   * @internal Called when a property of the placement changes. The argument is true if the bindings must change:
   * visibility, or another modifier.
   */
  readonly #onChange: (ofList: boolean) => void;
  #sceneToWorld: Matrix4 | undefined;
  #opacity = 1;
  #crop: Box | undefined;
  #visible: boolean;
  #modifier: PlacementModifier | undefined;
  /** Bounds in the scene's own coordinates, for {@link boundsOfWorld}. */
  bounds: Bounds | undefined;

  /** Created by {@link World.add}. */
  constructor(placed: Placed, onChange: (ofList: boolean) => void) {
    this.#onChange = () => undefined;
    this.scene = placed.scene;
    this.bounds = placed.bounds;
    this.sceneToWorld = placed.sceneToWorld;
    this.opacity = placed.opacity ?? 1;
    this.crop = placed.crop;
    this.#visible = placed.visible ?? true;
    this.#modifier = placed.modifier;
    this.#onChange = onChange;
  }

  /**
   * Matrix from scene to world coordinates; undefined for the identity. The matrix is copied.
   * @throws GaussianSplatError `argument/value` for a matrix that is not affine, not finite or not invertible.
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

  /**
   * Opacity of the scene, 0 to 1.
   * @throws GaussianSplatError `argument/value` for a number below 0 or above 1.
   */
  get opacity(): number {
    return this.#opacity;
  }

  set opacity(opacity: number) {
    if (!(opacity >= 0 && opacity <= 1)) throw wrong('opacity', 'a number from 0 to 1', opacity);
    if (opacity === this.#opacity) return;
    this.#opacity = opacity;
    this.#onChange(false);
  }

  /**
   * Box in the scene's own coordinates that contains the centers of the drawn splats; undefined for no crop.
   * @throws GaussianSplatError `argument/value` for corners that are not three numbers each.
   */
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

  /**
   * Cuts, tints, reveals or moves splats of the scene. Compile the pipelines of the modifier first, so that no frame
   * compiles them.
   */
  get modifier(): PlacementModifier | undefined {
    return this.#modifier;
  }

  set modifier(modifier: PlacementModifier | undefined) {
    // If the page sets the same modifier again, only its values have changed, not the list of scenes.
    const ofList = modifier !== this.#modifier;
    this.#modifier = modifier;
    this.#onChange(ofList);
  }
}

/**
 * Scenes that are drawn together: sorted together, so that they occlude one another. Any number of {@link Viewpoint}s
 * may draw one world.
 *
 * ```ts
 * const world = new World();
 * const room = world.add({ scene: roomGaussians });
 * const plant = world.add({ scene: plantGaussians, sceneToWorld: [1, 0, 0, 1.2, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1] });
 * plant.opacity = 0.8;
 * ```
 *
 * A world holds no memory of its own: scenes belong to their creators, and must outlive their placements.
 */
export class World {
  #placements: readonly Placement[] = [];
  #layout = 0;
  #changes = 0;

  /** All placements, visible or not, in the order of their addition. This order decides between equal depths. */
  get placements(): readonly Placement[] {
    return this.#placements;
  }

  /** Incremented when a scene is added, removed, shown or hidden, or gets another modifier. */
  get layout(): number {
    return this.#layout;
  }

  /** Incremented when a property of a placement changes that {@link layout} does not count. */
  get changes(): number {
    return this.#changes;
  }

  /**
   * Adds a scene. One scene may have several placements.
   * @throws GaussianSplatError `argument/value` for a placement out of range.
   */
  add(placed: Placed): Placement {
    if (typeof placed?.scene !== 'object' || !Array.isArray(placed.scene?.blocks))
      throw wrong('scene', 'a GaussianScene: GaussianBuffers, DynamicGaussians, …', placed?.scene);
    const placement = new Placement(placed, (ofList) => {
      // A placement that was removed from the world changes nothing.
      if (!this.#placements.includes(placement)) return;
      if (ofList) this.#layout++;
      else this.#changes++;
    });
    this.#placements = [...this.#placements, placement];
    this.#layout++;
    return placement;
  }

  /**
   * Removes a placement; does nothing if it was removed before. The memory of its scene belongs to the creator, and
   * stays allocated.
   */
  remove(placement: Placement): void {
    const left = this.#placements.filter((other) => other !== placement);
    if (left.length === this.#placements.length) return;
    this.#placements = left;
    this.#layout++;
  }
}

function requireAffine(m: Matrix4): void {
  const isAffine =
    m.length === 16 && m.every(Number.isFinite) && m[12] === 0 && m[13] === 0 && m[14] === 0 && m[15] === 1;
  if (isAffine && Number.isFinite(1 / linearDeterminant(m))) return;
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
