/** Loaded when an element has meshes: only this module depends on three.js. */
import { multiply, type Matrix4, type Vector3 } from '@gaussian-splat/core';
import type { FrameTarget } from '@gaussian-splat/renderer';
import type { ProbeAnswer, ProbePoint } from '@gaussian-splat/renderer/tools';
import { credentialsOf } from '../attributes.js';
import type { LoadedGaussians, MeshModel } from '../gpu/loaded-gaussians.js';
import { limited } from '../gpu/open-scene.js';
import type { Frame } from '../dynamic/frame-filter.js';
import type { SourceEntry } from '../source-entry.js';
import type { WorldEntry } from '../world-entry.js';
import type { ViewerFrame } from '../camera/orbit.js';
import { MeshLayer, type MeshHit } from './mesh-layer.js';
import type { Model } from './model.js';
import { fetchMesh, openModel } from './open-mesh.js';

/** A mesh with its transform. */
export interface PlacedModel {
  readonly model: MeshModel;
  readonly toWorld: Matrix4;
}

/** From a glTF's axes, y up, to those of the cloud that its splats are read as. */
const GLTF_TO_CLOUD: Matrix4 = [-1, 0, 0, 0, 0, -1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1];
/** Interface of the element for meshes. */
interface MeshCore {
  readonly frame: ViewerFrame;
  warn(sentence: string): void;
}

const IDENTITY: Matrix4 = [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1];

/** Meshes among the splats of an element. */
export class Meshes {
  readonly #sources: { readonly members: readonly WorldEntry[] };
  readonly #core: MeshCore;
  /** The layer that draws them, if there are any. */
  #layer: MeshLayer | undefined;
  #preparing = Promise.resolve();

  constructor(sources: { readonly members: readonly WorldEntry[] }, core: MeshCore) {
    this.#sources = sources;
    this.#core = core;
  }

  /** Drawn meshes with their transforms. */
  get #models(): readonly PlacedModel[] {
    return this.#sources.members.flatMap(({ scene, placement }) => {
      const { model, hasMeshes } = scene;
      if (!model || !placement.visible) return [];
      const { sceneToWorld = IDENTITY } = placement;
      return [{ model, toWorld: hasMeshes ? multiply(sceneToWorld, GLTF_TO_CLOUD) : sceneToWorld }];
    });
  }

  /** Changes whenever they do. */
  get version(): string {
    return this.#models.map(({ model }) => model.version).join();
  }

  /** Creates the layer of a device, once, and compiles the materials of a model. */
  prepare({ device, model }: Pick<LoadedGaussians, 'device' | 'model'>): Promise<void> {
    const prepare = async (): Promise<void> => {
      if (this.#layer?.device !== device) {
        this.#layer?.destroy();
        this.#layer = undefined;
        this.#layer = await MeshLayer.create(device);
      }
      if (model) await this.#layer.compile(model as Model);
    };
    const prepared = this.#preparing.then(prepare);
    this.#preparing = prepared.catch(() => undefined);
    return prepared;
  }

  /**
   * Fetches the triangles of a file that has splats, too. Rejects with the signal's reason if the splats are gone
   * meanwhile.
   */
  async add(
    { attributes, services, memoryBudget, scene: { url } }: SourceEntry,
    scene: LoadedGaussians,
  ): Promise<void> {
    const { signal } = scene;
    const request = { url, credentials: credentialsOf(attributes.crossorigin), limits: services.sceneLimits };
    const mesh = await fetchMesh(services.sceneLoader, limited(request, { memoryBudget }), signal);
    for (const warning of mesh.warnings) this.#core.warn(`<gaussian-splat>: ${warning}`);
    const model = await openModel(mesh, url, { device: scene.device, signal, memoryBudget });
    await this.prepare({ device: scene.device, model });
    if (signal.aborted) model.dispose();
    signal.throwIfAborted();
    scene.model = model;
  }

  /** Draws them into a frame. @returns The target for splats over them. */
  draw(frame: Frame): Partial<FrameTarget> {
    const models = this.#models;
    return this.#layer && models.length > 0 ? this.#layer.draw(frame, models, this.#core.frame) : {};
  }

  /** Corrects the probe results of splats behind meshes. */
  async probe(points: readonly ProbePoint[], answers: readonly ProbeAnswer[]): Promise<readonly ProbeAnswer[]> {
    return this.#layer && this.#models.length > 0 ? this.#layer.probe(points, answers) : answers;
  }

  /**
   * The source of the first triangle on a ray, and the names of the mesh and its material; null for none. Origin and
   * direction in viewer space.
   */
  hit(origin: Vector3, direction: Vector3): (Omit<MeshHit, 'model'> & { readonly member: WorldEntry }) | null {
    const met = this.#layer?.hit(origin, direction);
    const member = met && this.#sources.members.find(({ scene }) => scene.model === met.model);
    return member ? { member, mesh: met.mesh, material: met.material } : null;
  }

  /** Frees unused resources. */
  forget(): void {
    if (this.#sources.members.some(({ scene }) => scene.model)) return;
    this.#layer?.destroy();
    this.#layer = undefined;
  }
}
