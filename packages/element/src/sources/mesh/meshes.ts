/** Meshes of an element. Loaded on demand, because of three.js, which only code behind this module uses. */
import { multiply, type Matrix4, type Vector3 } from '@gaussian-splat/core';
import type { FrameTarget } from '@gaussian-splat/renderer';
import type { ProbeAnswer, ProbePoint } from '@gaussian-splat/renderer/tools';
import { credentialsOf } from '../../viewer/attributes.js';
import type { LoadedGaussians, MeshModel } from '../../gpu/loaded-gaussians.js';
import { limited } from '../../gpu/memory-budget.js';
import type { Frame } from '../generator/frame-filter.js';
import type { SourceEntry } from '../../viewer/source-entry.js';
import type { WorldEntry } from '../../viewer/world-entry.js';
import type { ViewerFrame } from '../../viewer/camera/orbit.js';
import { MeshLayer, type MeshHit } from './mesh-layer.js';
import type { Model } from './model.js';
import { fetchMesh, openModel } from './open-mesh.js';

/** A model with its transform from its own coordinates to the world. */
export interface PlacedModel {
  readonly model: MeshModel;
  readonly toWorld: Matrix4;
}

/** From the axes of glTF (y up) to those of the cloud that its splats are read as (y down). */
const GLTF_TO_CLOUD: Matrix4 = [-1, 0, 0, 0, 0, -1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1];
/** The part of the element that meshes use. */
interface MeshCore {
  readonly frame: ViewerFrame;
  warn(sentence: string): void;
}

const IDENTITY: Matrix4 = [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1];

/** Draws the meshes of an element together with its splats. */
export class Meshes {
  readonly #sources: { readonly members: readonly WorldEntry[] };
  readonly #core: MeshCore;
  /** The layer that draws the meshes; undefined while there are none. */
  #layer: MeshLayer | undefined;
  #preparing = Promise.resolve();
  /** Models that are being prepared, or are prepared but not yet in the world, with their scenes. */
  readonly #coming = new Map<MeshModel, LoadedGaussians>();

  constructor(sources: { readonly members: readonly WorldEntry[] }, core: MeshCore) {
    this.#sources = sources;
    this.#core = core;
  }

  /** Visible models with their transforms. */
  get #models(): readonly PlacedModel[] {
    return this.#sources.members.flatMap(({ scene, placement }) => {
      const { model, hasMeshes } = scene;
      if (!model || !placement.visible) return [];
      const { sceneToWorld = IDENTITY } = placement;
      return [{ model, toWorld: hasMeshes ? multiply(sceneToWorld, GLTF_TO_CLOUD) : sceneToWorld }];
    });
  }

  /** Versions of all visible models: the text changes whenever an animation moves one of them. */
  get version(): string {
    return this.#models.map(({ model }) => model.version).join();
  }

  /** Compiles the materials of a model, after creating the layer of the scene's device if there is none. */
  prepare(scene: LoadedGaussians, model = scene.model): Promise<void> {
    const { device } = scene.place;
    if (model) this.#coming.set(model, scene);
    const prepare = async (): Promise<void> => {
      if (this.#layer?.device !== device) {
        this.#layer?.destroy();
        this.#layer = undefined;
        this.#layer = await MeshLayer.create(device);
      }
      if (model) await this.#layer.compile(model as Model);
    };
    const prepared = this.#preparing.then(prepare);
    this.#preparing = prepared
      .catch(() => model && this.#coming.delete(model))
      .then(() => {
        // The scene was destroyed during the preparation.
        if (scene.isDestroyed) this.forget();
      });
    return prepared;
  }

  /**
   * Adds the triangles of a file that also has splats to its scene. Rejects with the signal's reason if the scene is
   * destroyed meanwhile.
   */
  async add(
    { attributes, services, memoryBudget, scene: { url } }: SourceEntry,
    scene: LoadedGaussians,
  ): Promise<void> {
    const { signal } = scene;
    const request = { url, credentials: credentialsOf(attributes.crossorigin), limits: services.sceneLimits };
    const mesh = await fetchMesh(services.sceneLoader, limited(request, memoryBudget), signal);
    for (const warning of mesh.warnings) this.#core.warn(`<gaussian-splat>: ${warning}`);
    const model = await openModel(mesh, url, { device: scene.place.device, signal, memoryBudget });
    await this.prepare(scene, model);
    if (signal.aborted) model.dispose();
    signal.throwIfAborted();
    scene.model = model;
  }

  /**
   * Draws the visible models into a frame.
   * @returns Properties of the target that let the splats blend with the models; none without models.
   */
  draw(frame: Frame): Partial<FrameTarget> {
    const models = this.#models;
    return this.#layer && models.length > 0 ? this.#layer.draw(frame, models, this.#core.frame) : {};
  }

  /**
   * Returns the probe answers, corrected for meshes: the depth of a mesh in front of the splats, and transmittance 0
   * for a requested depth behind a mesh.
   */
  async probe(points: readonly ProbePoint[], answers: readonly ProbeAnswer[]): Promise<readonly ProbeAnswer[]> {
    return this.#layer && this.#models.length > 0 ? this.#layer.probe(points, answers) : answers;
  }

  /**
   * Returns the source, mesh name and material name of the first triangle on a ray; null if there is none. Origin and
   * direction in viewer space.
   */
  hit(origin: Vector3, direction: Vector3): (Omit<MeshHit, 'model'> & { readonly member: WorldEntry }) | null {
    const met = this.#layer?.hit(origin, direction);
    const member = met && this.#sources.members.find(({ scene }) => scene.model === met.model);
    return member ? { member, mesh: met.mesh, material: met.material } : null;
  }

  /** Frees the layer if no source has or is about to have a model. */
  forget(): void {
    const models = this.#sources.members.flatMap(({ scene }) => scene.model ?? []);
    for (const [model, scene] of this.#coming)
      if (scene.isDestroyed || models.includes(model)) this.#coming.delete(model);
    if (this.#coming.size + models.length > 0) return;
    this.#layer?.destroy();
    this.#layer = undefined;
  }
}
