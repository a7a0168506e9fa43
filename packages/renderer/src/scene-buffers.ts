import type { ShDegree, Vector3 } from '@gaussian-splat/core';
import type { GaussianBlock, GaussianScene } from './gaussian-scene.js';
import { BufferOwner, type GpuMemory } from './gpu/memory.js';
import type { ShPrecision } from './pack/words.js';

/** Properties of a scene that do not depend on its buffers. Default `shPrecision`: float16, which stages write. */
type SceneHead = Pick<GaussianScene, 'shDegree' | 'antialiased' | 'filterVariance' | 'origin'> &
  Partial<Pick<GaussianScene, 'shPrecision'>>;

/** Gaussians in buffers of their own, which are destroyed with the scene. */
export abstract class SceneBuffers extends BufferOwner implements GaussianScene {
  /** Capacity in splats, over all levels of detail. */
  readonly count: number;
  readonly shDegree: ShDegree;
  readonly shPrecision: ShPrecision;
  readonly antialiased: boolean;
  readonly filterVariance?: number | undefined;
  /** World position, in float64, of the origin of the positions on the GPU. */
  readonly origin: Vector3;
  abstract readonly blocks: readonly GaussianBlock[];
  abstract readonly version: number;

  constructor(
    memory: GpuMemory,
    { shDegree, shPrecision = 'float16', antialiased, filterVariance, origin }: SceneHead,
    count: number,
  ) {
    super(memory);
    this.count = count;
    this.shDegree = shDegree;
    this.shPrecision = shPrecision;
    this.antialiased = antialiased;
    this.filterVariance = filterVariance;
    this.origin = origin;
  }
}
