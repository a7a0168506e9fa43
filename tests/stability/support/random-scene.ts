/** Scenes and cameras at random, in a form that fast-check shrinks and JSON keeps. */
import { lookAt, type Camera, type GaussianCloud, type ShDegree, type Vector3 } from '@gaussian-splat/core';
import fc from 'fast-check';
import { cloudOf } from '../../support/clouds.js';
import { seededRandom, type Quaternion } from '../../support/random.js';

/** One splat: plain numbers. */
export interface SplatRecipe {
  readonly position: readonly number[];
  /** Natural logarithms of the standard deviations; -Infinity is written as null. */
  readonly logScale: readonly (number | null)[];
  /** Not normalized. */
  readonly rotation: readonly number[];
  readonly opacity: number;
  readonly color: readonly number[];
}

/** A camera that looks at the scene. */
export interface CameraRecipe {
  readonly width: number;
  readonly height: number;
  readonly fovDegrees: number;
  readonly eye: readonly number[];
  readonly target: readonly number[];
  readonly roll: number;
  /** Principal point, as fractions of the image beyond its middle. */
  readonly shift: readonly number[];
  readonly near: number;
}

/** All that one case of the fuzzer needs. */
export interface SceneRecipe {
  readonly splats: readonly SplatRecipe[];
  /** How often the splats are repeated, each time a little aside and in other colors. */
  readonly copies: number;
  readonly shDegree: ShDegree;
  readonly seed: number;
  readonly camera: CameraRecipe;
  readonly mode: 'classic' | 'antialiased';
  readonly turning: boolean;
}

const double = (min: number, max: number): fc.Arbitrary<number> => fc.double({ min, max, noNaN: true });
const vector = (min: number, max: number): fc.Arbitrary<number[]> =>
  fc.array(double(min, max), { minLength: 3, maxLength: 3 });

/** Mostly ordinary, sometimes flat, thin, minute or huge. */
const logScale: fc.Arbitrary<number | null> = fc.oneof(
  { weight: 12, arbitrary: double(-5, -0.5) },
  { weight: 3, arbitrary: double(-16, 3) },
  { weight: 1, arbitrary: fc.constant(null) },
);

const opacity: fc.Arbitrary<number> = fc.oneof(
  { weight: 8, arbitrary: double(0, 1) },
  { weight: 1, arbitrary: fc.constantFrom(0, 0.0039, 1 / 255, 0.00393, 0.99, 0.999, 1) },
);

const splat: fc.Arbitrary<SplatRecipe> = fc
  .record({
    position: vector(-3, 3),
    logScale: fc.array(logScale, { minLength: 3, maxLength: 3 }),
    rotation: fc.array(fc.integer({ min: -9, max: 9 }), { minLength: 4, maxLength: 4 }),
    opacity,
    color: fc.array(fc.oneof({ weight: 6, arbitrary: double(0, 1) }, { weight: 1, arbitrary: double(-0.5, 1.5) }), {
      minLength: 3,
      maxLength: 3,
    }),
  })
  .filter(({ logScale, rotation }) => logScale.some((s) => s !== null) && rotation.some((q) => q !== 0));

const camera: fc.Arbitrary<CameraRecipe> = fc
  .record({
    width: fc.integer({ min: 1, max: 96 }),
    height: fc.integer({ min: 1, max: 96 }),
    fovDegrees: fc.oneof({ weight: 5, arbitrary: double(30, 100) }, { weight: 1, arbitrary: double(5, 160) }),
    eye: vector(-6, 6),
    target: vector(-1, 1),
    roll: double(-3.2, 3.2),
    shift: fc.oneof(
      { weight: 4, arbitrary: fc.constant([0, 0]) },
      { weight: 1, arbitrary: fc.array(double(-1, 1), { minLength: 2, maxLength: 2 }) },
    ),
    near: fc.constantFrom(0.2, 0.01),
  })
  .filter(({ eye, target }) => Math.hypot(...eye.map((x, k) => x - target[k])) > 0.1);

export const sceneRecipe: fc.Arbitrary<SceneRecipe> = fc.record({
  splats: fc.array(splat, { minLength: 1, maxLength: 40 }),
  copies: fc.constantFrom(1, 1, 4, 16),
  shDegree: fc.constantFrom<ShDegree>(0, 0, 1, 2, 3),
  seed: fc.nat(1_000_000),
  camera,
  mode: fc.constantFrom('classic' as const, 'classic' as const, 'antialiased' as const),
  turning: fc.boolean(),
});

export function cloudOfRecipe({ splats, copies, shDegree, seed }: SceneRecipe): GaussianCloud {
  const random = seededRandom(seed);
  const described = Array.from({ length: copies }, (_, copy) =>
    splats.map(({ position, logScale, rotation, opacity, color }) => ({
      position: position.map((x) => (copy ? x + 0.3 * random.normal() : x)) as unknown as Vector3,
      scale: logScale.map((s) => (s === null ? 0 : Math.exp(s))) as unknown as Vector3,
      rotation: rotation as unknown as Quaternion,
      opacity,
      color: color.map((c) => (copy ? c * random.uniform(0.5, 1) : c)) as unknown as Vector3,
      sh: Array.from({ length: 3 * (shDegree + 1) ** 2 - 3 }, () => 0.1 * random.normal()),
    })),
  ).flat();
  return cloudOf(described, shDegree);
}

export function cameraOfRecipe(recipe: CameraRecipe): Camera {
  const { width, height, fovDegrees, eye, target, roll, shift, near } = recipe;
  const focal = width / 2 / Math.tan((fovDegrees * Math.PI) / 360);
  const up: Vector3 = [Math.sin(roll), -Math.cos(roll), 0.1];
  return {
    width,
    height,
    fx: focal,
    fy: focal,
    cx: width * (0.5 + shift[0]),
    cy: height * (0.5 + shift[1]),
    worldToCamera: lookAt(eye as unknown as Vector3, target as unknown as Vector3, up),
    near,
    far: 1e10,
  };
}
