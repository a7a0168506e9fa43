import { GaussianSplatError, sceneHostOf, type HostedGaussians, type SceneHost } from '@gaussian-splat/core';
import type { GaussianLayout } from '@gaussian-splat/core/contract';
import type { DynamicGaussians, Placed, Placement, World } from '@gaussian-splat/renderer';
import type { GaussianSink } from './generator.js';

/** The Gaussians of a model in a {@link World}. */
export interface PlacedGaussians extends HostedGaussians<DynamicGaussians> {
  readonly placement: Placement;
}

/** A scene of three.js that `@gaussian-splat/three` draws. */
export interface ThreeScene {
  readonly isObject3D: true;
  add(...objects: never[]): unknown;
}

/** Host for worlds of `@gaussian-splat/renderer`, which is loaded for the first model in a world. */
const worldHost = {
  accepts: (scene: unknown): scene is World =>
    typeof scene === 'object' && scene !== null && 'placements' in scene && 'add' in scene && 'remove' in scene,
  async receive(
    world: World,
    device: GPUDevice,
    layout: GaussianLayout,
    placed: Omit<Placed, 'scene'> = {},
  ): Promise<PlacedGaussians> {
    const { DynamicGaussians } = await import('@gaussian-splat/renderer');
    const gaussians = await DynamicGaussians.create(device, layout);
    const placement = world.add({ ...placed, scene: gaussians });
    const remove = (): void => {
      world.remove(placement);
      gaussians.destroy();
    };
    return { gaussians, placement, remove };
  },
};

/**
 * Creates a sink for Gaussians and adds it to a scene of any registered renderer.
 * @throws GaussianSplatError `argument/value` for a scene without a renderer.
 */
export function receiveGaussians(
  scene: unknown,
  device: GPUDevice,
  layout: GaussianLayout,
  placed?: Omit<Placed, 'scene'>,
): Promise<HostedGaussians<GaussianSink>> {
  if (worldHost.accepts(scene)) return worldHost.receive(scene, device, layout, placed);
  const host = sceneHostOf(scene) as SceneHost<unknown, GPUDevice, GaussianSink> | undefined;
  if (host !== undefined) return host.receive(scene, device, layout);
  const isThree = (scene as Partial<ThreeScene> | null)?.isObject3D === true;
  throw new GaussianSplatError('argument/value', {
    where: 'scene of addGaussianModelToScene',
    expected: 'a World of @gaussian-splat/renderer, a scene of three.js, or a function that makes a sink',
    found: isThree ? 'a scene of three.js that no SplatRenderer draws' : describe(scene),
    remedy: isThree
      ? 'make a SplatRenderer of @gaussian-splat/three before: new SplatRenderer(renderer)'
      : 'create the world with new World(), and draw it with a Viewpoint',
  });
}

function describe(value: unknown): string {
  const name = typeof value === 'object' && value !== null ? value.constructor?.name : undefined;
  return name === undefined ? String(value) : `an object of ${name}`;
}
