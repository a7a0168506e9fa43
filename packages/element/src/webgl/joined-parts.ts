import type { PackedGaussians } from '@gaussian-splat/renderer';
import { GEOMETRY_WORDS, shWords, type BlockBuffers } from '@gaussian-splat/renderer/tools';
import type { ScenePart } from '../loading/protocol.js';

/** Joins the parts of a scene that was requested for WebGPU, which uploads parts. */
export class JoinedParts {
  /** The scene; complete after the last part. Undefined without parts. */
  packed: PackedGaussians | undefined;

  readonly add = async (part: ScenePart): Promise<BlockBuffers | undefined> => {
    if ('head' in part) {
      const { count, shDegree, shPrecision } = part.head;
      const [geometry, sh] = [GEOMETRY_WORDS, shWords(shDegree, shPrecision)].map((n) => new Uint32Array(n * count));
      this.packed = { ...part.head, geometry, sh, chunks: new Float32Array() };
      return undefined;
    }
    const { start = 0, geometry, sh, chunks } = part.portion;
    const packed = this.packed!;
    if (geometry) packed.geometry.set(geometry, GEOMETRY_WORDS * start);
    if (sh) packed.sh.set(sh, shWords(packed.shDegree, packed.shPrecision) * start);
    if (chunks) this.packed = { ...packed, chunks };
    return geometry ? (part.portion as BlockBuffers) : undefined;
  };
}
