/**
 * S27. Composition.
 *
 * Who fails: renderers that sort each scene separately and draw one after the other (three.js splat meshes without a common sort, CSS layers, one element over
 * another): splats of a scene that reaches into another are then all in front or all behind. Meshes that cut through splats are either before or behind all of them.
 *
 * Recipe: asked for two scenes that reach into one another, turned around, a plane through both, a scene added and one moved between frames, one scene in two
 * places, and two viewpoints of one world in turn. Run so with both rasterizers; the laboratory turns further.
 *
 * Passes: at least 59 dB to the float64 oracle of all of them together.
 */
import { test } from 'node:test';
import { multiply, type Matrix4 } from '@gaussian-splat/core';
import { capture, GaussianBuffers, packGaussians, SceneDepth, Viewpoint, World } from '@gaussian-splat/renderer';
import { renderOracleWorld, type PlacedCloud } from '../oracle/oracle.js';
import { cloudOf, repeat } from '../support/clouds.js';
import { closeness } from '../support/compare.js';
import { nodeDevice } from '../support/node-device.js';
import { seededRandom } from '../support/random.js';
import { cameraAt } from '../support/scenes.js';
import { RASTERIZERS, THREADS } from './support/images.js';
import { holds, sized } from './support/row.js';

const TURNS = sized(2, 12);
const [WIDTH, HEIGHT] = [120, 80];

const random = seededRandom(27);
const ball = (count: number) =>
  cloudOf(
    repeat(count, () => ({
      position: [random.uniform(-1, 1), random.uniform(-1, 1), random.uniform(-1, 1)],
      scale: [random.logUniform(0.02, 0.15), random.logUniform(0.02, 0.15), random.logUniform(0.02, 0.15)],
      rotation: random.rotation(),
      opacity: random.uniform(0.2, 1),
      color: [random.uniform(0, 1), random.uniform(0, 1), random.uniform(0, 1)],
    })),
  );
const clouds = [ball(600), ball(500), ball(400)];

const turned = (angle: number, x: number): Matrix4 => {
  const [c, s] = [Math.cos(angle), Math.sin(angle)];
  return [c, 0, s, x, 0, 1, 0, 0, -s, 0, c, 0.2, 0, 0, 0, 1];
};
const PLANE_DEPTH = 3.9;

for (const rasterizer of RASTERIZERS) {
  test(`scenes that reach into one another, ${rasterizer}: sorted and hidden as one`, async () => {
    const device = await nodeDevice();
    const scenes = await Promise.all(clouds.map((cloud) => GaussianBuffers.upload(device, packGaussians(cloud))));
    const world = new World();
    const settings = { threads: THREADS, rasterizer } as const;
    const [one, other] = [new Viewpoint(device, world, { settings }), new Viewpoint(device, world, { settings })];
    const texture = device.createTexture({ size: [WIDTH, HEIGHT], format: 'r32float', usage: 0x6 });
    const values = new Float32Array(WIDTH * HEIGHT).fill(PLANE_DEPTH);
    device.queue.writeTexture({ texture }, values, { bytesPerRow: 4 * WIDTH }, [WIDTH, HEIGHT]);
    const depth = new SceneDepth(device, { host: { texture } });
    const camera = cameraAt([0.4, -0.6, -4], [0, 0, 0], { width: WIDTH, height: HEIGHT });
    const placed: PlacedCloud[] = [];
    const add = (k: number, sceneToWorld: Matrix4) => {
      placed.push({ cloud: clouds[k], mode: 'classic', sceneToWorld });
      return world.add({ scene: scenes[k], sceneToWorld });
    };
    const min = { atLeast: 59, unit: 'dB' };
    const look = async (what: string, viewpoint: Viewpoint, angle: number, isCut = false): Promise<void> => {
      const view = { ...camera, worldToCamera: multiply(camera.worldToCamera, turned(angle, 0)) };
      const pixels = await capture(device, viewpoint, { camera: view, depth: isCut ? depth : undefined });
      const oracle = renderOracleWorld(placed, view, { rules: 'gsplat', depth: isCut ? values : undefined });
      holds('S27', `${rasterizer}, ${what}`, closeness(pixels, oracle).psnr, min);
    };
    add(0, turned(0, -0.3));
    const moving = add(1, turned(1, 0.3));
    for (let turn = 0; turn < TURNS; turn++) await look('two scenes, turned', one, turn * 0.5);
    await look('a plane through both', one, 0.3, true);
    await look('another viewpoint meanwhile', other, 1.2);
    for (let step = 0; step < TURNS; step++) {
      const sceneToWorld = turned(1 + 0.4 * step, 0.3);
      moving.sceneToWorld = sceneToWorld;
      placed[1] = { ...placed[1], sceneToWorld };
      if (step === 1) add(2, turned(2, 0));
      await look('one moves, one comes', one, 0.1 * step);
    }
    add(0, turned(2.5, 0.8));
    await look('one scene in two places', one, 0.2);
    await look('the same, from the other viewpoint', other, 0.7, true);
    for (const each of [one, other, depth, texture, ...scenes]) each.destroy();
  });
}
