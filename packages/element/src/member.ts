import type { Placed, Placement, World } from '@gaussian-splat/renderer';
import type { LoadedGaussians } from './gpu/loaded-gaussians.js';

/** A loaded source in the world. */
export class Member {
  readonly scene: LoadedGaussians;
  readonly #world: World;
  #placement: Placement;

  constructor(world: World, scene: LoadedGaussians) {
    this.#world = world;
    this.scene = scene;
    this.#placement = this.#add({ bounds: scene.bounds });
  }

  /** How it stands in the world. Other splats of the source may be drawn now than in the last frame: levels of detail, or a sequence's next buffers. */
  get placement(): Placement {
    const before = this.#placement;
    if (before.scene !== this.scene.drawn) {
      this.remove();
      const { sceneToWorld, opacity, crop, visible, bounds } = before;
      this.#placement = this.#add({ sceneToWorld, opacity, crop, visible, bounds });
    }
    return this.#placement;
  }

  remove(): void {
    this.#world.remove(this.#placement);
  }

  #add(placed: Omit<Placed, 'scene'>): Placement {
    return this.#world.add({ ...placed, scene: this.scene.drawn });
  }
}
