/** Loaded by workers that read and pack shares of a large PLY, and put its blocks in order. */
import { readPrefix, samplePreview } from '@gaussian-splat/formats';
import {
  layoutOf,
  packShare,
  sortBlock,
  type PackedShare,
  type ShareBlock,
  type ShareLayout,
  type ShPrecision,
  type SortedBlock,
} from '@gaussian-splat/renderer/tools';
import type { GaussianCloud, ShDegree, Vector3 } from '@gaussian-splat/core';
import { buffersOf } from './protocol.js';

/** Rows of a PLY. */
export interface ShareRows {
  /** A PLY: the file's header, and these rows alone. */
  readonly bytes: Uint8Array<ArrayBuffer>;
  /** Of the file. */
  readonly name: string;
}

/** The number of a piece of work, and which beginning of all work it belongs to. */
interface Ticket {
  readonly ticket: number;
  readonly epoch: number;
}

/** Rows to be packed, or a block to be put in order. */
export type HelperRequest = Ticket &
  ({ readonly rows: ShareRows; readonly layout: ShareLayout } | { readonly block: ShareBlock });

export interface HelperAnswer extends Ticket {
  /** The memory of the request, for another one: memory that is new costs more time than what is written to it. */
  readonly room?: ArrayBuffer;
  readonly share?: ReadShare;
  readonly block?: SortedBlock;
}

/** Rows that have been read. */
export interface ReadShare {
  /** Undefined if none of the rows can be drawn, or they could not be read. */
  readonly packed?: PackedShare | undefined;
  /** Some of the splats. */
  readonly preview?: GaussianCloud | undefined;
  readonly shDegree?: ShDegree;
  readonly antialiased?: boolean;
  readonly order?: 'pixel' | undefined;
  readonly filterVariance?: number | undefined;
  /** What the file says points up. */
  readonly up?: Vector3 | undefined;
  readonly origin?: Vector3;
  /** What of the file is not drawn. */
  readonly warnings?: readonly string[] | undefined;
}

/** The layout of a scene by some of its rows. Undefined if they hold no splat. */
export async function layoutBy({ bytes, name }: ShareRows, precision: ShPrecision): Promise<ShareLayout | undefined> {
  const cloud = await readPrefix(bytes, { name });
  return cloud && layoutOf(cloud, precision);
}

/** Reads and packs some rows. Never throws for what is in them. */
export async function packRows({ bytes, name }: ShareRows, layout: ShareLayout): Promise<ReadShare> {
  const cloud = await readPrefix(bytes, { name });
  if (cloud === undefined) return {};
  const { shDegree, antialiased, filterVariance, origin, hints, warnings } = cloud;
  const { positions, scales, rotations, opacities, sh } = cloud;
  const share = {
    ...{ shDegree, antialiased, filterVariance, origin, up: hints?.up, order: hints?.order, warnings },
    packed: packShare(cloud, layout),
    preview: samplePreview(cloud),
  };
  release(positions, scales, rotations, opacities, sh);
  return share;
}

/** Gives memory back at once. Browsers count such buffers late: without it those of many shares lie side by side. Older ones cannot do it. */
export function release(...arrays: ArrayBufferView[]): void {
  for (const { buffer } of arrays) (buffer as { transfer?: (bytes: number) => unknown }).transfer?.(0);
}

/** Does the work that comes through a port until the worker is ended. */
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
    // The thread that waits for the answer does the work again if none comes.
    packRows(data.rows, data.layout).then(
      (share) => answer({ ticket, epoch, room, share }),
      () => answer({ ticket, epoch, room, share: {} }),
    );
  });
  port.start();
}
