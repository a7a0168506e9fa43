/** Cuts and contact shadows of scenes that are measured. */
import { GaussianBuffers, packGaussians } from '@gaussian-splat/renderer';
import { SplatModifier, SplatProgram, tinted } from '@gaussian-splat/renderer/modifiers';

const EFFECTS = { hide: { opacity: 0 }, tint: { color: tinted([1, 0.4, 0.3], 1) } };
/** Frames until a cut that moves is where it was, and how far it moves, in radii of the scenes. */
const [THERE_AND_BACK, WAY] = [40, 0.25];
/** Splats of a shadow: 48 x 48, as the element's. */
const CELLS = 48;

/**
 * A sphere that cuts all scenes.
 * @param how.moves whether it moves in each frame
 * @param how.radius of all scenes together, world units
 * @returns what is called before each frame, with the world and its number
 */
export async function cutScenes(device, scenes, { effect, moves = false, radius }) {
  const program = await SplatProgram.compile(device, scenes);
  const modifiers = scenes.map(() => new SplatModifier(device, program));
  return ({ placements }, frame) => {
    const phase = moves ? frame % THERE_AND_BACK : 0;
    const x = WAY * radius * (Math.min(phase, THERE_AND_BACK - phase) / THERE_AND_BACK);
    const shapeToWorld = [radius, 0, 0, x, 0, radius, 0, 0, 0, 0, radius, 0, 0, 0, 0, 1];
    const cuts = [{ shape: 'sphere', shapeToWorld, ...EFFECTS[effect] }];
    modifiers.forEach((modifier, k) => {
      modifier.write({ cuts }, placements[k]);
      placements[k].modifier = modifier;
    });
  };
}

/** Flat black splats on the ground (y points down) under a subject of that radius. */
export async function addShadow(device, world, radius) {
  const count = CELLS ** 2;
  const [positions, scales] = [new Float32Array(3 * count), new Float32Array(3 * count)];
  const rotations = new Float32Array(4 * count);
  const step = (2 * radius) / CELLS;
  for (let i = 0; i < count; i++) {
    positions.set([((i % CELLS) + 0.5) * step - radius, 0.3, (Math.floor(i / CELLS) + 0.5) * step - radius], 3 * i);
    scales.set([0.7 * step, 1e-4 * step, 0.7 * step], 3 * i);
    rotations[4 * i] = 1;
  }
  const opacities = new Float32Array(count).fill(0.1);
  // Black: its constant band takes away the middle gray that harmonics are added to.
  const sh = new Float32Array(3 * count).fill(-0.5 / 0.28209479);
  const cloud = { count, positions, scales, rotations, opacities, sh, shDegree: 0, origin: [0, 0, 0] };
  world.add({ scene: await GaussianBuffers.upload(device, packGaussians({ ...cloud, antialiased: false })) });
}
