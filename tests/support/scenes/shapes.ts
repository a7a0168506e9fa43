/** Splats of extreme shape and size. */
import { cloudOf, repeat } from '../clouds.js';
import { seededRandom } from '../random.js';
import { cameraAt, type Scene } from './scene.js';

/** 3,000 needles, 10 to 1,000,000 times as long as they are thick, from less than a pixel to right across the screen. */
export function needles(): Scene {
  const random = seededRandom(3);
  const splats = repeat(3_000, () => {
    const long = random.logUniform(1e-3, 3);
    return {
      position: [random.uniform(-2, 2), random.uniform(-1.5, 1.5), random.uniform(-1, 3)] as const,
      scale: [long / random.logUniform(10, 1e6), long, long / random.logUniform(10, 1e6)] as const,
      rotation: random.rotation(),
      opacity: random.uniform(0.1, 1),
      color: [random.uniform(0, 1), random.uniform(0, 1), random.uniform(0, 1)] as const,
    };
  });
  return {
    name: 'needles',
    cloud: cloudOf(splats),
    cameras: [cameraAt([0, 0, -4], [0, 0, 0], { width: 400, height: 300 })],
  };
}

/** 2,000 discs of thickness exactly 0, every second one seen exactly from its edge. */
export function edgeOnDiscs(): Scene {
  const random = seededRandom(4);
  const splats = repeat(2_000, (i) => ({
    position: [random.uniform(-2, 2), random.uniform(-1.5, 1.5), i % 2 ? 0 : random.uniform(-1, 2)] as const,
    // Unrotated, the disc lies in the x-z plane; the eye is at y = 0, so a disc at height 0 is a line.
    scale: [random.logUniform(0.01, 0.6), 0, random.logUniform(0.01, 0.6)] as const,
    rotation: i % 2 ? ([1, 0, 0, 0] as const) : random.rotation(),
    opacity: random.uniform(0.1, 1),
    color: [random.uniform(0, 1), random.uniform(0, 1), random.uniform(0, 1)] as const,
  })).map((splat, i) => (i % 2 ? { ...splat, position: [splat.position[0], 0, splat.position[2]] as const } : splat));
  return {
    name: 'edgeOnDiscs',
    cloud: cloudOf(splats),
    cameras: [cameraAt([0, 0, -4], [0, 0, 0], { width: 360, height: 270 })],
  };
}

/** 500 splats larger than the view before 4,000 ordinary ones; the camera is inside many, and many cross the near plane. */
export function hugeSplats(): Scene {
  const random = seededRandom(5);
  const huge = repeat(500, () => ({
    position: [random.uniform(-4, 4), random.uniform(-3, 3), random.uniform(-6, 4)] as const,
    scale: [random.logUniform(0.3, 30), random.logUniform(0.3, 30), random.logUniform(0.05, 5)] as const,
    rotation: random.rotation(),
    opacity: random.logUniform(0.004, 0.03),
    color: [random.uniform(0, 1), random.uniform(0, 1), random.uniform(0, 1)] as const,
  }));
  // Centers just beyond the near plane and far off the axis: so that the Jacobian explodes unless it is clamped.
  const crossing = repeat(100, () => ({
    position: [random.uniform(-3, 3), random.uniform(-2, 2), -4 + 0.2 + random.logUniform(1e-4, 0.5)] as const,
    scale: [random.logUniform(0.01, 2), random.logUniform(0.01, 2), random.logUniform(0.01, 2)] as const,
    rotation: random.rotation(),
    opacity: random.uniform(0.01, 0.06),
    color: [random.uniform(0, 1), random.uniform(0, 1), random.uniform(0, 1)] as const,
  }));
  const ordinary = repeat(4_000, () => ({
    position: [random.uniform(-3, 3), random.uniform(-2, 2), random.uniform(1, 4)] as const,
    scale: random.logUniform(0.02, 0.2),
    opacity: random.uniform(0.2, 1),
    color: [random.uniform(0, 1), random.uniform(0, 1), random.uniform(0, 1)] as const,
  }));
  return {
    name: 'hugeSplats',
    cloud: cloudOf([...huge, ...crossing, ...ordinary]),
    cameras: [
      cameraAt([0, 0, -4], [0, 0, 0], { width: 360, height: 240 }),
      cameraAt([0.5, -0.3, -1], [1.5, 0.2, 3], { width: 320, height: 240, fovXDegrees: 110 }),
    ],
  };
}

/** 60,000 splats of about a pixel or much less, a dense ball far away; the dilation alone decides how they look. */
export function pixelSplats(): Scene {
  const random = seededRandom(6);
  const distance = 100;
  const splats = repeat(60_000, () => {
    const [x, y, z] = random.direction();
    const radius = 30 * Math.cbrt(random.uniform(0, 1));
    return {
      position: [x * radius, y * radius, z * radius + distance] as const,
      // A pixel covers about 0.29 world units there.
      scale: [random.logUniform(0.002, 0.3), random.logUniform(0.002, 0.3), random.logUniform(0.002, 0.3)] as const,
      rotation: random.rotation(),
      opacity: random.uniform(0.02, 1),
      color: [0.5 + x / 2, 0.5 + y / 2, 0.5 + z / 2] as const,
    };
  });
  return {
    name: 'pixelSplats',
    cloud: cloudOf(splats),
    cameras: [cameraAt([0, 0, 0], [0, 0, distance], { width: 480, height: 360 })],
  };
}
