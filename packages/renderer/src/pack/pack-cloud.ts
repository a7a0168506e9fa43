import { loadModule, validateCloud, type GaussianCloud } from '@gaussian-splat/core';
import { JoinedBlocks } from './joined-blocks.js';
import { packGaussians, type PackedGaussians, type PackedHead, type PackOptions } from './pack.js';
import { recentered } from './recenter.js';
import type * as rows from './row-packer.js';
import type { BlockReceiver } from './row-packer.js';
import { type ShPrecision } from './words.js';

/** Minimum number of splats that are packed in WebAssembly, whose code is loaded for this purpose. */
const MANY_SPLATS = 1 << 14;

const loadPacker = (): Promise<typeof rows> =>
  loadModule('the code that packs large scenes', () => import('./row-packer.js'));

/** Starts to load and to compile the code that packs large clouds. A failure is reported when it is used. */
export async function prepareToPack(): Promise<void> {
  await loadPacker().then(
    ({ packerCode }) => packerCode(),
    () => undefined,
  );
}

/** Receives a large cloud in blocks. */
export interface CloudReceiver {
  readonly head: (head: PackedHead) => void;
  readonly block: BlockReceiver;
}

/**
 * Packs a cloud as `packGaussians` does, to the same bytes, in WebAssembly if that is available. Rejects as
 * `packGaussians` throws.
 * @param receiver Receives the splats if WebAssembly packs them. The result then lacks them.
 */
export async function packCloud(
  given: GaussianCloud,
  options: PackOptions = {},
  receiver?: CloudReceiver,
): Promise<PackedGaussians> {
  validateCloud(given);
  if (given.count < MANY_SPLATS) return packGaussians(given, options);
  const { sh = 'auto' } = options;
  const cloud = recentered(given);
  const first = sh === 'auto' ? 'int8' : sh;
  const packer = await packed(cloud, first);
  if (!packer) return packGaussians(given, options);
  const precision = packer.precisionFor(sh);
  const needed = precision === first ? packer : await packed(cloud, precision);
  return needed ? joined(needed, cloud, precision, receiver) : packGaussians(given, options);
}

async function packed(cloud: GaussianCloud, shPrecision: ShPrecision): Promise<rows.RowPacker | undefined> {
  const { shDegree, count } = cloud;
  const { RowPacker } = await loadPacker();
  const packer = await RowPacker.open(count, { shDegree, shPrecision, moved: [0, 0, 0] });
  packer?.pushCloud(cloud);
  packer?.sort();
  return packer;
}

async function joined(
  packer: rows.RowPacker,
  cloud: GaussianCloud,
  shPrecision: ShPrecision,
  receiver: CloudReceiver | undefined,
): Promise<PackedGaussians> {
  const { shDegree, antialiased, filterVariance, origin, count } = cloud;
  const facts = { antialiased, filterVariance, origin, droppedCount: cloud.droppedCount + count - packer.count };
  const blocks = new JoinedBlocks({ shDegree, shPrecision, moved: [0, 0, 0] }, packer.count, facts, receiver?.block);
  receiver?.head(blocks.head);
  await packer.finish((block) => blocks.add(block));
  return blocks.packed;
}
