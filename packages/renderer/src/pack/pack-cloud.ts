import { validateCloud, type GaussianCloud } from '@gaussian-splat/core';
import { JoinedBlocks } from './joined-blocks.js';
import { packGaussians, type PackedGaussians, type PackOptions } from './pack.js';
import { recentered } from './recenter.js';
import { RowPacker } from './row-packer.js';
import { type ShPrecision } from './words.js';

/**
 * Packs a cloud as `packGaussians` does, to the same bytes, in WebAssembly if that is available. Rejects as
 * `packGaussians` throws.
 */
export async function packCloud(given: GaussianCloud, options: PackOptions = {}): Promise<PackedGaussians> {
  validateCloud(given);
  const { sh = 'auto' } = options;
  const cloud = recentered(given);
  const first = sh === 'auto' ? 'int8' : sh;
  const packer = await packed(cloud, first);
  if (!packer) return packGaussians(given, options);
  const precision = packer.precisionFor(sh);
  const needed = precision === first ? packer : await packed(cloud, precision);
  return needed ? joined(needed, cloud, precision) : packGaussians(given, options);
}

async function packed(cloud: GaussianCloud, shPrecision: ShPrecision): Promise<RowPacker | undefined> {
  const { shDegree, count } = cloud;
  const packer = await RowPacker.open(count, { shDegree, shPrecision, moved: [0, 0, 0] });
  packer?.pushCloud(cloud);
  packer?.sort();
  return packer;
}

async function joined(packer: RowPacker, cloud: GaussianCloud, shPrecision: ShPrecision): Promise<PackedGaussians> {
  const { shDegree, antialiased, filterVariance, origin, count } = cloud;
  const facts = { antialiased, filterVariance, origin, droppedCount: cloud.droppedCount + count - packer.count };
  const blocks = new JoinedBlocks({ shDegree, shPrecision, moved: [0, 0, 0] }, packer.count, facts);
  await packer.finish((block) => blocks.add(block));
  return blocks.packed;
}
