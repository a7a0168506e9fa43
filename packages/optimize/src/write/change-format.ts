import { GaussianSplatError, type GaussianCloud } from '@gaussian-splat/core';
import type { TaskPool } from '../parts/task-pool.js';
import { encodingsFor, type Encoders } from './index.js';

export interface ChangeFormatOptions extends Encoders {
  /** Name of the output file, whose extension selects the format. */
  readonly name: string;
  readonly pool?: TaskPool;
}

/**
 * Writes a whole cloud in the finest encoding of a format, without a GPU: no splat is dropped, and nothing is measured.
 * @returns Bytes of the file, and the title of its encoding.
 * @throws GaussianSplatError `argument/value` for a name with an unknown extension, for properties of the cloud that the
 * format cannot store, and for SOG without an encoder; `out-of-memory/allocation`
 */
export async function changeFormat(
  cloud: GaussianCloud,
  { name, pool, encodeWebp }: ChangeFormatOptions,
): Promise<{ readonly bytes: Uint8Array; readonly encoding: string }> {
  if (cloud.count === 0)
    throw new GaussianSplatError('argument/value', {
      where: name,
      expected: 'a scene with splats',
      found: 'none',
      remedy: 'pass a scene that can be drawn',
    });
  const last = encodingsFor(name, cloud, { encodeWebp }).at(-1)!;
  const encoding = last.finest?.(cloud) ?? last;
  const degrees = new Uint8Array(cloud.count).fill(cloud.shDegree);
  return { bytes: await encoding.write({ cloud, degrees }, pool), encoding: encoding.title };
}
