/**
 * Values of the camera for scripts. Each `toString()` returns a valid attribute, so that pages can store and restore
 * the values.
 */
import type { SplatGroup } from '../../shared/splat-groups.js';

/** Position of the camera around its target. */
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
  /** Distance to the target in meters (world units). */
  readonly radius: number;
  /** Distance in meters that frames the scene at this aspect ratio: `100%` of `camera-orbit`. */
  readonly framingRadius: number;

  /** Returns a value for `camera-orbit`, in radians and meters, because only they restore the pose without rounding. */
  toString(): string {
    return `${this.theta}rad ${this.phi}rad ${this.radius}m`;
  }
}

/** The point that the camera looks at and orbits: meters in viewer space (y up, right-handed). */
export class CameraTarget {
  constructor(x: number, y: number, z: number) {
    this.x = x;
    this.y = y;
    this.z = z;
  }
  readonly x: number;
  readonly y: number;
  readonly z: number;

  /** Returns a value for `camera-target`. */
  toString(): string {
    return `${this.x}m ${this.y}m ${this.z}m`;
  }
}

/** A point of the scene: meters in viewer space (y up, right-handed). */
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
   * Half of an interval along the line of sight, in units of viewer space, that contains the surface in 68 % of the
   * cases or more: small on a smooth surface, large on a rough one and at edges. Infinity if the splats show no single surface:
   * at glass, in haze, and on a splat that nothing surrounds.
   */
  readonly uncertainty: number;

  /** Returns a value for `data-position` of a hotspot, and for `camera-target`. */
  toString(): string {
    return `${this.x}m ${this.y}m ${this.z}m`;
  }
}

/** A point of the visible surface under a point of the page, and the element that contains the surface. */
export interface PickedPoint extends ScenePoint {
  /** The `<splat-scene>` or `<splat-mesh>` at the point, or the `<gaussian-splat>` itself for its own scene. */
  readonly element: Element;
  /** Unit normal of the surface in viewer space, towards the camera. Of rough surfaces it is off by about 10 degrees. */
  readonly normal: { readonly x: number; readonly y: number; readonly z: number };
  /** Distance from the eye, in units of viewer space. */
  readonly distance: number;
  /**
   * Index of the splat in its scene, in the storage order of the renderer; null for a mesh, and for levels of detail.
   * For a file, `packedOrder` of `@gaussian-splat/renderer/tools` maps it to a row.
   */
  readonly splat: number | null;
  /** Group of the splat, if the attribute `groups` reads them; otherwise null. */
  readonly group: SplatGroup | null;
  /** Name of the triangle mesh in its file, empty if it has none; null for splats. */
  readonly mesh: string | null;
  /** Name of the mesh's material in its file, empty if it has none; null for splats. */
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

  /** Returns a value for `field-of-view`. */
  toString(): string {
    return `${this.radians}rad`;
  }
}
