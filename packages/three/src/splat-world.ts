import { Viewpoint, World, type FrameSettings, type Placement } from '@gaussian-splat/renderer';
import type { Camera, Object3D } from 'three/webgpu';
import { isSplatScene, type SplatScene } from './splat-scene.js';

/** The splats of a three.js scene as one camera sees them. */
export class SplatWorld {
  readonly viewpoint: Viewpoint;
  readonly #world = new World();
  readonly #placements = new Map<SplatScene, Placement>();

  constructor(device: GPUDevice, settings: FrameSettings, onIncomplete: () => void) {
    this.viewpoint = new Viewpoint(device, this.#world, { settings, onIncomplete });
  }

  /** True if there is something to draw. */
  get isEmpty(): boolean {
    return !this.#world.placements.some(({ visible }) => visible);
  }

  /** Takes over what the scene graph says: which splats there are, where, and which are hidden. */
  follow(root: Object3D, camera: Camera): void {
    const seen = new Set<SplatScene>();
    root.traverseVisible((object) => {
      if (isSplatScene(object) && object.layers.test(camera.layers)) seen.add(object);
    });
    for (const splats of seen) this.#place(splats);
    for (const [splats, placement] of this.#placements) {
      if (seen.has(splats)) continue;
      // Hidden ones, too: what is not visible holds no room.
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

/** three.js keeps matrices by columns. */
const rowMajor = (elements: readonly number[]): number[] =>
  elements.map((_, k) => elements[4 * (k % 4) + Math.floor(k / 4)]);
