import type { GaussianLayout } from './contract/index.js';

/** Gaussians of a generator that stand in a scene of a renderer. */
export interface HostedGaussians<Sink = unknown> {
  /** Takes what each run writes: a `GaussianSink` of `@gaussian-splat/generator`. */
  readonly gaussians: Sink;
  /** Takes them out of the scene and frees their memory. */
  remove(): void;
}

/** A renderer whose scenes take the Gaussians of generators. */
export interface SceneHost<Scene = unknown, Device = never, Sink = unknown> {
  /** Whether it draws this scene. */
  accepts(scene: unknown): scene is Scene;
  /** Adds Gaussians to it. @throws GaussianSplatError as `DynamicGaussians.create` of the renderer does. */
  receive(scene: Scene, device: Device, layout: GaussianLayout): Promise<HostedGaussians<Sink>>;
}

const hosts: SceneHost[] = [];

/** Makes the scenes of a renderer known to `addGaussianModelToScene`. A host that is known already stays as it is. */
export function registerSceneHost(host: SceneHost): void {
  if (!hosts.includes(host)) hosts.push(host);
}

/** The registered host that draws a scene; undefined if none does. */
export const sceneHostOf = (scene: unknown): SceneHost | undefined => hosts.find((host) => host.accepts(scene));
