/** Loaded by workers that read and pack shards of a large PLY, and sort its blocks. */
import { readPrefix, samplePreview } from '@gaussian-splat/formats';
import {
  layoutOf,
  packShard,
  sortBlock,
  type PackedShard,
  type ShareBlock,
  type ShareLayout,
  type ShPrecision,
  type SortedBlock,
} from '@gaussian-splat/renderer/tools';
import type { GaussianCloud, ShDegree, Vector3 } from '@gaussian-splat/core';
import { buffersOf } from './protocol.js';

/** Rows of a PLY. */
export interface ShareRows {
  /** A PLY with the file's header, and only these rows. */
  readonly bytes: Uint8Array<ArrayBuffer>;
  /** Name of the file. */
  readonly name: string;
}

/** Number of a task, and the epoch of the whole work. */
interface Ticket {
  readonly ticket: number;
  readonly epoch: number;
}

/** Rows to pack, or a block to sort. */
export type HelperRequest = Ticket &
  ({ readonly rows: ShareRows; readonly layout: ShareLayout } | { readonly block: ShareBlock });

export interface HelperAnswer extends Ticket {
  /** The memory of the request, for reuse, because allocating costs more time than writing. */
  readonly room?: ArrayBuffer;
  readonly share?: ReadShare;
  readonly block?: SortedBlock;
}

/** Result of reading rows. */
export interface ReadShare {
  /** Undefined if no row is usable, or they could not be read. */
  readonly packed?: PackedShard | undefined;
  /** Some of the splats. */
  readonly preview?: GaussianCloud | undefined;
  readonly shDegree?: ShDegree;
  readonly antialiased?: boolean;
  readonly order?: 'pixel' | undefined;
  readonly filterVariance?: number | undefined;
  /** Up direction that the file declares. */
  readonly up?: Vector3 | undefined;
  readonly origin?: Vector3;
  /** Messages about content that is not drawn. */
  readonly warnings?: readonly string[] | undefined;
}

/** The layout of a scene from some of its rows. Undefined if they hold no splat. */
export async function layoutBy({ bytes, name }: ShareRows, precision: ShPrecision): Promise<ShareLayout | undefined> {
  const cloud = await readPrefix(bytes, { name });
  return cloud && layoutOf(cloud, precision);
}

/** Reads and packs some rows. Never throws for invalid content. */
export async function packRows({ bytes, name }: ShareRows, layout: ShareLayout): Promise<ReadShare> {
  const cloud = await readPrefix(bytes, { name });
  if (cloud === undefined) return {};
  const { shDegree, antialiased, filterVariance, origin, hints, warnings } = cloud;
  const { positions, scales, rotations, opacities, sh } = cloud;
  const share = {
    ...{ shDegree, antialiased, filterVariance, origin, up: hints?.up, order: hints?.order, warnings },
    packed: packShard(cloud, layout),
    preview: samplePreview(cloud),
  };
  release(positions, scales, rotations, opacities, sh);
  return share;
}

/**
 * Frees memory at once. Garbage collection of such buffers is late, so that those of many shards would accumulate.
 * Older browsers do not support it.
 */
export function release(...arrays: ArrayBufferView[]): void {
  for (const { buffer } of arrays) (buffer as { transfer?: (bytes: number) => unknown }).transfer?.(0);
}

/** Runs the tasks from a port until the worker is terminated. */
export function packShares(port: MessagePort): void {
  const answer = (answer: HelperAnswer): void => {
    const { share, block, room } = answer;
    const parts = [share?.packed, share?.preview, block].filter((part) => part !== undefined);
    port.postMessage(answer, [...buffersOf(...parts), ...(room ? [room] : [])]);
  };
  port.addEventListener('message', ({ data }: MessageEvent<HelperRequest>) => {
    const { ticket, epoch } = data;
    const room = ('block' in data ? data.block.words : data.rows.bytes).buffer;
    if ('block' in data) return answer({ ticket, epoch, room, block: sortBlock(data.block) });
    // If no answer arrives, the waiting thread runs the task again.
    packRows(data.rows, data.layout).then(
      (share) => answer({ ticket, epoch, room, share }),
      () => answer({ ticket, epoch, room, share: {} }),
    );
  });
  port.start();
}
