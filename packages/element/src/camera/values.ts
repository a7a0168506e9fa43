/** Present camera values that people read, store and write back: each `toString()` is a valid attribute. */

/** Where the camera is, around its target. */
export class CameraOrbit {
  constructor(theta: number, phi: number, radius: number, framingRadius: number) {
    this.theta = theta;
    this.phi = phi;
    this.radius = radius;
    this.framingRadius = framingRadius;
  }
  /** Azimuth in radians: 0 on the +z side of viewer space, growing towards +x. */
  readonly theta: number;
  /** Polar angle in radians: 0 straight above the target, π straight below. */
  readonly phi: number;
  /** Distance to the target in metres (world units). */
  readonly radius: number;
  /** The distance that frames the scene in this shape of the element: `100%` of `camera-orbit`. */
  readonly framingRadius: number;

  /** A value for `camera-orbit`. Radians and metres, since only they survive the way there and back unrounded. */
  toString(): string {
    return `${this.theta}rad ${this.phi}rad ${this.radius}m`;
  }
}

/** The point that the camera looks at and turns around: metres in viewer space (y up, right-handed). */
export class CameraTarget {
  constructor(x: number, y: number, z: number) {
    this.x = x;
    this.y = y;
    this.z = z;
  }
  readonly x: number;
  readonly y: number;
  readonly z: number;

  /** A value for `camera-target`. */
  toString(): string {
    return `${this.x}m ${this.y}m ${this.z}m`;
  }
}

/** A point of the scene: metres in viewer space (y up, right-handed). */
export class ScenePoint {
  constructor(x: number, y: number, z: number, uncertainty = Infinity) {
    this.x = x;
    this.y = y;
    this.z = z;
    this.uncertainty = uncertainty;
  }
  readonly x: number;
  readonly y: number;
  readonly z: number;
  /**
   * Half of the distance along the line of sight over which the light goes from 90 % to 10 %, in units of viewer space: small on a solid surface, large at edges
   * and in haze. Infinity if more than 10 % pass.
   */
  readonly uncertainty: number;

  /** A value for `data-position` of a hotspot, and for `camera-target`. */
  toString(): string {
    return `${this.x}m ${this.y}m ${this.z}m`;
  }
}

/** A point of the visible surface under a point of the page, and whose it is. */
export interface PickedPoint extends ScenePoint {
  /** The `<splat-scene>` or `<splat-mesh>` that was met, or the `<gaussian-splat>` itself for its own scene. */
  readonly element: Element;
  /** From the eye, in units of viewer space. */
  readonly distance: number;
  /**
   * Number of the splat among those of its scene, in the order in which the renderer stores them; null for a mesh, and where levels of detail are drawn. Of a file, `packedOrder` of
   * `@gaussian-splat/renderer/tools` has the rows.
   */
  readonly splat: number | null;
  /** Name of the triangle mesh in its file, empty where it has none; null for splats. */
  readonly mesh: string | null;
  /** Name of its material, likewise. */
  readonly material: string | null;
}

/** Vertical field of view. */
export class FieldOfView {
  constructor(radians: number) {
    this.radians = radians;
  }
  readonly radians: number;

  get degrees(): number {
    return (this.radians * 180) / Math.PI;
  }

  /** A value for `field-of-view`. */
  toString(): string {
    return `${this.radians}rad`;
  }
}
