/** Packs clouds. The worker loads this module while a file is in transit. */
import type { GaussianCloud } from '@gaussian-splat/core';
import { innerViewOf } from '@gaussian-splat/core/views';
import { packCloud, type PackedGaussians, type PackOptions } from '@gaussian-splat/renderer/tools';
import type { PartListener } from './protocol.js';

export { innerViewOf, packCloud };
export { prepareToPack } from '@gaussian-splat/renderer/tools';

/** Sends the splats of a cloud as parts of a scene. Returns the packed cloud instead if it is too small for parts. */
export async function packCloudInto(
  onPart: PartListener,
  cloud: GaussianCloud,
  options: PackOptions,
): Promise<PackedGaussians | undefined> {
  let isSent = false;
  const packed = await packCloud(cloud, options, {
    head: (head) => {
      isSent = true;
      void onPart({ head });
    },
    block: ({ start, geometry, sh }) => onPart({ portion: { start, geometry, sh } }),
  });
  if (!isSent) return packed;
  void onPart({ portion: { chunks: packed.chunks as Float32Array<ArrayBuffer> } });
  return undefined;
}
