import type { GaussianLayout } from './contract/index.js';

/** Gaussians of a generator in a scene of another renderer. */
export interface HostedGaussians<Sink = unknown> {
  /** Accepts the output of each run: a `GaussianSink` of `@gaussian-splat/generator`. */
  readonly gaussians: Sink;
  /** Removes them from the scene and frees their memory. */
  remove(): void;
}

/** A renderer whose scenes accept the Gaussians of generators. */
export interface SceneHost<Scene = unknown, Device = never, Sink = unknown> {
  /** Whether it draws this scene. */
  accepts(scene: unknown): scene is Scene;
  /** Adds Gaussians to it. @throws GaussianSplatError as `DynamicGaussians.create` of the renderer does. */
  receive(scene: Scene, device: Device, layout: GaussianLayout): Promise<HostedGaussians<Sink>>;
}

const hosts: SceneHost[] = [];

/** Registers the scenes of a renderer for `addGaussianModelToScene`. Repeated registration has no effect. */
export function registerSceneHost(host: SceneHost): void {
  if (!hosts.includes(host)) hosts.push(host);
}

/** The registered host that draws a scene; undefined if none does. */
export const sceneHostOf = (scene: unknown): SceneHost | undefined => hosts.find((host) => host.accepts(scene));
