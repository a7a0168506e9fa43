import type { Placed, Placement, World } from '@gaussian-splat/renderer';
import type { SceneBounds } from './camera/settings.js';
import type { LoadedGaussians } from '../gpu/loaded-gaussians.js';

/** A loaded source in the world. */
export class WorldEntry {
  readonly scene: LoadedGaussians;
  readonly #world: World;
  #placement: Placement;
  #bounds: SceneBounds;

  constructor(world: World, scene: LoadedGaussians) {
    this.#world = world;
    this.scene = scene;
    this.#bounds = scene.bounds;
    this.#placement = this.#add({ bounds: this.#bounds });
  }

  /**
   * Placement of the source in the world. The getter replaces it if the drawn splats have changed since the last frame:
   * by levels of detail, or by the next buffers of a sequence.
   */
  get placement(): Placement {
    const before = this.#placement;
    if (before.scene !== this.scene.drawn) {
      this.remove();
      const { sceneToWorld, opacity, crop, visible, modifier, bounds } = before;
      this.#placement = this.#add({ sceneToWorld, opacity, crop, visible, modifier, bounds });
    }
    const { bounds } = this.scene;
    if (bounds !== this.#bounds) this.#placement.bounds = this.#bounds = bounds;
    return this.#placement;
  }

  remove(): void {
    this.#world.remove(this.#placement);
  }

  #add(placed: Omit<Placed, 'scene'>): Placement {
    return this.#world.add({ ...placed, scene: this.scene.drawn });
  }
}
