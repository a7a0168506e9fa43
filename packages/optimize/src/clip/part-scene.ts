import type { GaussianCloud } from '@gaussian-splat/core';
import type { Encoding } from '../write/index.js';
import { filesOfZip, writeZip } from '../write/zip.js';

const META = 'meta.json';
interface Codebook {
  codebook: readonly number[];
}
type SogMeta = Partial<Record<'scales' | 'sh0' | 'shN', Codebook>>;

/**
 * Encodes splats as the scene file of a part. Codebooks of SOG end with their last value, because the reader of clips
 * repeats it: the 256 values that other readers want take a tenth of a small part.
 */
export async function writePartScene(cloud: GaussianCloud, encoding: Encoding): Promise<Uint8Array<ArrayBuffer>> {
  const degrees = new Uint8Array(cloud.count).fill(cloud.shDegree);
  const bytes = new Uint8Array(await encoding.write({ cloud, degrees }));
  if (!encoding.sog) return bytes;
  const files = filesOfZip(bytes);
  const meta = JSON.parse(new TextDecoder().decode(files.get(META))) as SogMeta;
  for (const part of [meta.scales, meta.sh0, meta.shN]) if (part) part.codebook = withoutRepetitions(part.codebook);
  return writeZip(new Map([...files, [META, new TextEncoder().encode(JSON.stringify(meta))]]));
}

function withoutRepetitions(values: readonly number[]): readonly number[] {
  let { length } = values;
  while (length > 1 && values[length - 1] === values[length - 2]) length--;
  return values.slice(0, length);
}
