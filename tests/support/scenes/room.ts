/** The hardest ordinary case: a camera inside, large faint splats all around it, a sky far outside, colors by direction. */
import { scale, type Vector3 } from '@gaussian-splat/core';
import { cloudOf, repeat, type SplatDescription } from '../clouds.js';
import { seededRandom, type Quaternion, type Random } from '../random.js';
import { cameraAt, type Scene } from './scene.js';

/** Half the size of the room in world units; y points down, so the floor is at +HALF.y. */
const HALF = { x: 4, y: 1.5, z: 3 };
const DEGREE = 3;

/** 30,000 splats with SH of degree 3; two cameras inside, one of them close to a wall that it looks along. */
export function room(): Scene {
  const random = seededRandom(2);
  const splats = [
    ...repeat(2_000, () => skySplat(random)),
    ...repeat(20_700, () => wallSplat(random)),
    ...repeat(7_000, () => furnitureSplat(random)),
    ...repeat(300, () => hazeSplat(random)),
  ];
  return {
    name: 'room',
    cloud: cloudOf(splats, DEGREE),
    cameras: [
      cameraAt([-2.2, -0.1, -1.5], [1.5, 0.3, 1.6], { width: 480, height: 320, fovXDegrees: 75 }),
      cameraAt([-3.7, 0.2, -2.6], [-3.4, 0.2, 2.5], { width: 400, height: 300, fovXDegrees: 100 }),
    ],
  };
}

function skySplat(random: Random): SplatDescription {
  const size = random.uniform(3, 7);
  return {
    position: scale(random.direction(), random.uniform(60, 80)),
    scale: [size, size * random.uniform(0.3, 1), size * random.uniform(0.3, 1)],
    rotation: random.rotation(),
    opacity: random.uniform(0.5, 1),
    color: [random.uniform(0.4, 0.7), random.uniform(0.6, 0.8), random.uniform(0.8, 1.1)],
    sh: shBands(random, 0.1),
  };
}

/** A thin disc on one of the six faces of the room; the wall at +x is a window for the most part. */
function wallSplat(random: Random): SplatDescription {
  const position = [random.uniform(-1, 1) * HALF.x, random.uniform(-1, 1) * HALF.y, random.uniform(-1, 1) * HALF.z];
  const axis = Math.floor(random.uniform(0, 3));
  const side = random.uniform(0, 1) < 0.5 ? -1 : 1;
  const isWindow = axis === 0 && side === 1 && Math.abs(position[1]) < 0.9 && Math.abs(position[2]) < 2;
  position[axis] = side * [HALF.x, HALF.y, HALF.z][axis];
  const thickness = random.logUniform(1e-4, 0.02);
  const spread: [number, number, number] = [random.logUniform(0.01, 0.15), random.logUniform(0.01, 0.15), thickness];
  const checker = (Math.floor(position[0] * 2) + Math.floor(position[1] * 2) + Math.floor(position[2] * 2)) & 1;
  return {
    position: position as unknown as Vector3,
    scale: spread,
    rotation: facing(axis, random.uniform(0, 2 * Math.PI)),
    opacity: isWindow ? random.uniform(0, 0.1) : random.uniform(0.2, 1),
    color: checker ? [0.8, 0.7, 0.55] : [0.35, 0.3, 0.4],
    sh: shBands(random, 0.15),
  };
}

function furnitureSplat(random: Random): SplatDescription {
  const center = [
    [1.5, 0.8, 1.5],
    [-1, 1.1, 1.8],
    [2.5, 0.2, -0.5],
  ][Math.floor(random.uniform(0, 3))];
  return {
    position: [
      center[0] + 0.4 * random.normal(),
      center[1] + 0.25 * random.normal(),
      center[2] + 0.4 * random.normal(),
    ],
    scale: [random.logUniform(0.003, 0.1), random.logUniform(0.003, 0.1), random.logUniform(0.003, 0.1)],
    rotation: random.rotation(),
    opacity: random.uniform(0.05, 1),
    color: [random.uniform(0, 1), random.uniform(0, 0.6), random.uniform(0, 0.5)],
    sh: shBands(random, 0.25),
  };
}

/** Large and faint, anywhere in the room, the camera inside some of them. */
function hazeSplat(random: Random): SplatDescription {
  return {
    position: [random.uniform(-1, 1) * HALF.x, random.uniform(-1, 1) * HALF.y, random.uniform(-1, 1) * HALF.z],
    scale: [random.uniform(0.3, 2), random.uniform(0.3, 2), random.uniform(0.3, 2)],
    rotation: random.rotation(),
    opacity: random.uniform(0.002, 0.03),
    color: [0.7, 0.7, 0.75],
    sh: shBands(random, 0.05),
  };
}

/** A rotation that turns the local z axis along a world axis, and by `roll` radians about it. */
function facing(axis: number, roll: number): Quaternion {
  const h = Math.SQRT1_2;
  const turn: Quaternion = [[h, 0, h, 0] as const, [h, -h, 0, 0] as const, [1, 0, 0, 0] as const][axis];
  const [c, s] = [Math.cos(roll / 2), Math.sin(roll / 2)];
  // turn · (c, 0, 0, s)
  return [turn[0] * c - turn[3] * s, turn[1] * c + turn[2] * s, turn[2] * c - turn[1] * s, turn[3] * c + turn[0] * s];
}

/** The 15 coefficients after the constant, three channels each, fainter with each degree. */
function shBands(random: Random, strength: number): number[] {
  return Array.from({ length: 45 }, (_, i) => {
    const coefficient = Math.floor(i / 3) + 1;
    return (strength * random.normal()) / Math.floor(Math.sqrt(coefficient));
  });
}
