/**
 * Captures the opacity of all scenes that WebGPU draws, in small images. Reads back from the GPU, so it is never part
 * of a frame.
 */
import type { Camera, SplatFilter } from '@gaussian-splat/core';
import {
  capture,
  Viewpoint,
  World,
  type FrameSettings,
  type FrameTarget,
  type GaussianScene,
} from '@gaussian-splat/renderer';
import type { WorldEntry } from '../viewer/world-entry.js';
import { SHADOW_PIXELS, type TakeAlpha } from './shadow-map.js';

export interface AlphaSource {
  readonly device: GPUDevice;
  readonly members: readonly WorldEntry[];
  readonly settings: FrameSettings;
  readonly filter: SplatFilter | undefined;
  /**
   * Draws the meshes beneath the splats, from a camera.
   * @returns properties of the target that let the splats blend with the meshes
   */
  drawBeneath(camera: Camera): Partial<FrameTarget>;
}

/** Returns a function that captures images of all scenes. Call `free` after the last image. */
export function alphaOfWorld({ device, members, settings, filter, drawBeneath }: AlphaSource): {
  readonly take: TakeAlpha;
  free(): void;
} {
  const world = worldOf(members);
  const viewpoint = new Viewpoint(device, world, { settings: { ...settings, shDegree: 0 } });
  return {
    take: async (camera) => {
      const pixels = await capture(device, viewpoint, { camera, filter, ...drawBeneath(camera) });
      return Float32Array.from({ length: SHADOW_PIXELS ** 2 }, (_, i) => pixels[4 * i + 3]);
    },
    free: () => viewpoint.destroy(),
  };
}

/** Returns a world of the splats of all members alone, for other views. */
export function worldOf(members: readonly WorldEntry[]): World {
  const world = new World();
  for (const { placement } of members) {
    const { scene, sceneToWorld, opacity, crop, visible, modifier } = placement;
    world.add({ scene: asItIs(scene), sceneToWorld, opacity, crop, visible, modifier });
  }
  return world;
}

/** Returns a copy of a scene without streaming, so that the view from above requests no pages. */
const asItIs = (scene: GaussianScene): GaussianScene => {
  const { count, shDegree, shPrecision, antialiased, filterVariance, origin, blocks, version } = scene;
  return { count, shDegree, shPrecision, antialiased, filterVariance, origin, blocks: blocks, version };
};
