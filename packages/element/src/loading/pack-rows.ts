/** Packs rows for another worker. Helpers load this module. */
import { RowPacker, type PackableRows, type RowLayout } from '@gaussian-splat/renderer/tools';

/** The first message to a helper. */
export interface HelperTask {
  readonly rows: PackableRows;
  readonly layout: RowLayout;
}

/** Rows to pack, in a buffer that is transferred to the helper and back. */
export interface RowBatch {
  readonly bytes: Uint8Array<ArrayBuffer>;
  /** Index in the scene of the first row. */
  readonly first: number;
}

/** Packed splats, as `RowPacker.take` writes them, in the buffer of their rows. */
export interface PackedBatch {
  readonly bytes: Uint8Array<ArrayBuffer>;
  readonly first: number;
  /** Number of splats; undefined if the helper cannot pack. */
  readonly count: number | undefined;
}

/** Answers each {@link RowBatch} from a port with a {@link PackedBatch}, until the worker is terminated. */
export function packRows(port: MessagePort): void {
  let opening: Promise<RowPacker | undefined> | undefined;
  port.onmessage = async ({ data }: MessageEvent<HelperTask | RowBatch>) => {
    if ('layout' in data) return void (opening = RowPacker.open(data.rows, data.layout));
    const packer = await opening;
    packer?.push(data.bytes);
    port.postMessage({ ...data, count: packer?.take(data.bytes) } satisfies PackedBatch, [data.bytes.buffer]);
  };
}
