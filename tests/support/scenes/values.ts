/** Ordinary shapes with extreme opacities, colors, depths, positions and cameras. */
import { add, multiply, type Camera, type Vector3 } from '@gaussian-splat/core';
import { cloudOf, repeat, type SplatDescription } from '../clouds.js';
import { seededRandom } from '../random.js';
import { cameraAt, type Scene } from './scene.js';

/** From nothing to fully opaque, densest near the thresholds: 1/255 (skip), 0.99 and 0.999 (caps). */
export const OPACITY_STEPS: readonly number[] = [
  ...[0, 1e-30, 1e-6, 0.001, 0.0035, 0.0039, 0.00392, 1 / 255, 0.003922, 0.00393, 0.004, 0.0045, 0.005, 0.01, 0.03],
  ...[0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 0.95, 0.98, 0.989, 0.99, 0.991, 0.995, 0.998, 0.999, 0.9995, 1],
];

/** Every opacity in a column of its own; each row puts one more splat behind, so that the last rows reach T < 1e-4. */
export function opacitySteps(): Scene {
  const random = seededRandom(7);
  const rows = 20;
  const column = (i: number): number => (i - (OPACITY_STEPS.length - 1) / 2) * 0.16;
  const splats: SplatDescription[] = [];
  OPACITY_STEPS.forEach((opacity, i) => {
    for (let row = 0; row < rows; row++) {
      for (let layer = 0; layer <= row; layer++) {
        splats.push({
          position: [column(i), (row - (rows - 1) / 2) * 0.17, layer * 0.01],
          scale: 0.05,
          opacity,
          color: [random.uniform(0, 1), random.uniform(0, 1), random.uniform(0, 1)],
        });
      }
    }
  });
  return {
    name: 'opacitySteps',
    cloud: cloudOf(splats),
    cameras: [cameraAt([0, 0, -4], [0, 0, 0], { width: 480, height: 320 })],
  };
}

/** Colors from far below 0 (cut to 0) to about 4 (not cut), from the constant term and from SH of degree 3. */
export function brightColors(): Scene {
  const random = seededRandom(8);
  const splats = repeat(5_000, () => ({
    position: [random.uniform(-2, 2), random.uniform(-1.5, 1.5), random.uniform(-1, 1)] as const,
    scale: [random.logUniform(0.01, 0.2), random.logUniform(0.01, 0.2), random.logUniform(0.01, 0.2)] as const,
    rotation: random.rotation(),
    opacity: random.uniform(0.1, 1),
    color: [random.uniform(-1.5, 4), random.uniform(-1.5, 4), random.uniform(-1.5, 4)] as const,
    sh: Array.from({ length: 45 }, () => 0.3 * random.normal()),
  }));
  return {
    name: 'brightColors',
    cloud: cloudOf(splats, 3),
    cameras: [cameraAt([0.5, -0.8, -3.5], [0, 0, 0], { width: 400, height: 300 })],
  };
}

/** 100,000 overlapping splats at exactly one depth, in float32 too: only their order in the cloud decides the image. */
export function equalDepthPlane(): Scene {
  const random = seededRandom(9);
  const splats = repeat(100_000, () => ({
    position: [random.uniform(-3, 3), random.uniform(-2, 2), 0] as const,
    scale: [random.logUniform(0.003, 0.03), random.logUniform(0.003, 0.03), random.logUniform(0.003, 0.03)] as const,
    rotation: random.rotation(),
    opacity: random.uniform(0.1, 1),
    color: [random.uniform(0, 1), random.uniform(0, 1), random.uniform(0, 1)] as const,
  }));
  const camera = cameraAt([0, 0, -4], [0, 0, 0], { width: 480, height: 320 });
  return { name: 'equalDepthPlane', cloud: cloudOf(splats), cameras: [camera] };
}

/** Principal points off the middle, one of them outside the image, with fx and fy that differ. */
export function offCenter(): Scene {
  const random = seededRandom(10);
  const splats = repeat(4_000, () => ({
    position: [random.uniform(-6, 6), random.uniform(-5, 5), random.uniform(-2.7, 3)] as const,
    scale: [random.logUniform(0.01, 0.4), random.logUniform(0.01, 0.4), random.logUniform(0.01, 0.4)] as const,
    rotation: random.rotation(),
    opacity: random.logUniform(0.01, 0.9),
    color: [random.uniform(0, 1), random.uniform(0, 1), random.uniform(0, 1)] as const,
  }));
  const base = cameraAt([0, 0, -3], [0, 0, 0], { width: 360, height: 270 });
  return {
    name: 'offCenter',
    cloud: cloudOf(splats),
    cameras: [
      { ...base, cx: 0.1 * base.width, cy: 0.8 * base.height, fy: 1.3 * base.fy },
      { ...base, cx: -0.3 * base.width, cy: 1.2 * base.height, fx: 0.8 * base.fx },
    ],
  };
}

/** The same scene far from the origin of the world, so float32 positions alone would be coarse. */
export function movedBy(scene: Scene, offset: Vector3): Scene {
  const moved = (camera: Camera): Camera => ({
    ...camera,
    worldToCamera: multiply(camera.worldToCamera, [
      1,
      0,
      0,
      -offset[0],
      0,
      1,
      0,
      -offset[1],
      0,
      0,
      1,
      -offset[2],
      0,
      0,
      0,
      1,
    ]),
  });
  return {
    name: `${scene.name} moved by ${offset.join(', ')}`,
    cloud: { ...scene.cloud, origin: add(scene.cloud.origin, offset) },
    cameras: scene.cameras.map(moved),
  };
}
