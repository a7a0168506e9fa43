import { Viewpoint, World, type FrameSettings, type Placement } from '@gaussian-splat/renderer';
import type { Camera, Object3D } from 'three/webgpu';
import { isSplatScene, type SplatScene } from './splat-scene.js';

/** The splats of a three.js scene as seen by one camera. */
export class SplatWorld {
  readonly viewpoint: Viewpoint;
  readonly #world = new World();
  readonly #placements = new Map<SplatScene, Placement>();

  constructor(device: GPUDevice, settings: FrameSettings, onIncomplete: () => void) {
    this.viewpoint = new Viewpoint(device, this.#world, { settings, onIncomplete });
  }

  /** Whether no visible splats are in the world. */
  get isEmpty(): boolean {
    return !this.#world.placements.some(({ visible }) => visible);
  }

  /** Synchronizes the world with the scene graph: the set of splats, their transforms and their visibility. */
  follow(root: Object3D, camera: Camera): void {
    const seen = new Set<SplatScene>();
    root.traverseVisible((object) => {
      if (isSplatScene(object) && object.layers.test(camera.layers) && isSolid(object)) seen.add(object);
    });
    for (const splats of seen) this.#place(splats);
    for (const [splats, placement] of this.#placements) {
      if (seen.has(splats)) continue;
      // Hidden splats are removed, too, so that they use no capacity.
      this.#world.remove(placement);
      this.#placements.delete(splats);
    }
  }

  #place(splats: SplatScene): void {
    const { gaussians: scene, opacity, crop } = splats;
    const sceneToWorld = rowMajor(splats.matrixWorld.elements);
    const known = this.#placements.get(splats);
    if (known?.scene === scene) {
      Object.assign(known, { sceneToWorld, opacity, crop });
      return;
    }
    if (known) this.#world.remove(known);
    this.#placements.set(splats, this.#world.add({ scene, sceneToWorld, opacity, crop }));
  }
}

/** Whether the matrix of an object can be inverted. A scale of 0 makes the object invisible, as it does with meshes. */
const isSolid = ({ matrixWorld }: Object3D): boolean => Number.isFinite(1 / matrixWorld.determinant());

/** Returns the elements of a matrix of three.js, which are column-major, in row-major order. */
const rowMajor = (elements: readonly number[]): number[] =>
  elements.map((_, k) => elements[4 * (k % 4) + Math.floor(k / 4)]);
