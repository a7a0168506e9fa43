import type { GaussianLayout } from './contract/index.js';

/** Gaussians of a generator that were added to a scene of another renderer. */
export interface HostedGaussians<Sink = unknown> {
  /** Accepts the output of each run of the generator: a `GaussianSink` of `@gaussian-splat/generator`. */
  readonly gaussians: Sink;
  /** Removes the Gaussians from the scene, and frees their memory. */
  remove(): void;
}

/** A renderer whose scenes accept the Gaussians of generators. */
export interface SceneHost<Scene = unknown, Device = never, Sink = unknown> {
  /** Whether this renderer draws the scene. */
  accepts(scene: unknown): scene is Scene;
  /**
   * Adds Gaussians to a scene of this renderer. @throws GaussianSplatError as `DynamicGaussians.create` of the renderer
   * does.
   */
  receive(scene: Scene, device: Device, layout: GaussianLayout): Promise<HostedGaussians<Sink>>;
}

const hosts: SceneHost[] = [];

/** Registers a renderer, whose scenes `addGaussianModelToScene` then accepts. Repeated registration has no effect. */
export function registerSceneHost(host: SceneHost): void {
  if (!hosts.includes(host)) hosts.push(host);
}

/** Returns the registered renderer that draws a scene; undefined if there is none. */
export const sceneHostOf = (scene: unknown): SceneHost | undefined => hosts.find((host) => host.accepts(scene));
