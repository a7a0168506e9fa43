import { Viewpoint, World, type FrameSettings, type Placement } from '@gaussian-splat/renderer';
import type { Camera, Object3D } from 'three/webgpu';
import { isSplatScene, type SplatScene } from './splat-scene.js';

/** The splats of a three.js scene for one camera. */
export class SplatWorld {
  readonly viewpoint: Viewpoint;
  readonly #world = new World();
  readonly #placements = new Map<SplatScene, Placement>();

  constructor(device: GPUDevice, settings: FrameSettings, onIncomplete: () => void) {
    this.viewpoint = new Viewpoint(device, this.#world, { settings, onIncomplete });
  }

  /** Whether there is something to draw. */
  get isEmpty(): boolean {
    return !this.#world.placements.some(({ visible }) => visible);
  }

  /** Synchronizes with the scene graph: the set of splats, their transforms and their visibility. */
  follow(root: Object3D, camera: Camera): void {
    const seen = new Set<SplatScene>();
    root.traverseVisible((object) => {
      if (isSplatScene(object) && object.layers.test(camera.layers)) seen.add(object);
    });
    for (const splats of seen) this.#place(splats);
    for (const [splats, placement] of this.#placements) {
      if (seen.has(splats)) continue;
      // Hidden ones are removed, too, so that they use no capacity.
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

/** three.js stores matrices column-major. */
const rowMajor = (elements: readonly number[]): number[] =>
  elements.map((_, k) => elements[4 * (k % 4) + Math.floor(k / 4)]);
