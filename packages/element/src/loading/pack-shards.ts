/**
 * Packs shards of a large PLY and sorts its blocks. The helping workers load this module, and so does the worker that
 * they help.
 */
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

/** Some rows of a PLY, as a file of their own. */
export interface ShareRows {
  /** The file's header followed by these rows. The header still declares the number of splats of the complete file. */
  readonly bytes: Uint8Array<ArrayBuffer>;
  /** Name of the file, for error messages. */
  readonly name: string;
}

/** Number of a task, and the epoch of the work: each restart of the work increments the epoch. */
interface Ticket {
  readonly ticket: number;
  readonly epoch: number;
}

/** A task of a helper: rows to pack, or a block to sort. */
export type HelperRequest = Ticket &
  ({ readonly rows: ShareRows; readonly layout: ShareLayout } | { readonly block: ShareBlock });

export interface HelperAnswer extends Ticket {
  /** The memory of the request, which is reused, because allocating memory takes longer than writing to it. */
  readonly room?: ArrayBuffer;
  readonly share?: ReadShare;
  readonly block?: SortedBlock;
}

/** Result of reading rows; empty if they contain no usable splat. */
export interface ReadShare {
  /** The packed splats; undefined if no row is usable, or the rows could not be read. */
  readonly packed?: PackedShard | undefined;
  /** A sample of the splats, for previews. */
  readonly preview?: GaussianCloud | undefined;
  readonly shDegree?: ShDegree;
  readonly antialiased?: boolean;
  readonly order?: 'pixel' | undefined;
  readonly filterVariance?: number | undefined;
  /** Up direction that the file declares; undefined if it declares none. */
  readonly up?: Vector3 | undefined;
  readonly origin?: Vector3;
  /** Messages about content that is not drawn. */
  readonly warnings?: readonly string[] | undefined;
}

/** Returns the layout of a scene, computed from some of its rows; undefined if these contain no usable splat. */
export async function layoutBy({ bytes, name }: ShareRows, precision: ShPrecision): Promise<ShareLayout | undefined> {
  const cloud = await readPrefix(bytes, { name });
  return cloud && layoutOf(cloud, precision);
}

/** Reads and packs some rows. Returns an empty object if they contain no usable splat. */
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
 * Frees the buffers of arrays at once, by transferring them. Garbage collection comes late, so the buffers of many
 * shards would accumulate. In browsers without `ArrayBuffer.transfer` this has no effect.
 */
export function release(...arrays: ArrayBufferView[]): void {
  for (const { buffer } of arrays) (buffer as { transfer?: (bytes: number) => unknown }).transfer?.(0);
}

/** Runs the tasks that arrive on a port, and posts the answers, until the worker is terminated. */
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
    // A failure is answered, too, as rows without splats. Without an answer, another thread would repeat the task.
    packRows(data.rows, data.layout).then(
      (share) => answer({ ticket, epoch, room, share }),
      () => answer({ ticket, epoch, room, share: {} }),
    );
  });
  port.start();
}
