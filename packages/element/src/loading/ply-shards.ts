/** Divides the rows of a large PLY into shards, which can be packed independently, and collects the packed shards. */
import type { SplatRanges } from '@gaussian-splat/formats';
import { SHARD_SPLATS, ShareCells, type ShareCell, type ShareLayout } from '@gaussian-splat/renderer/tools';
import { layoutBy, type ReadShare, type ShareRows } from './pack-shards.js';
import type { SceneRequest } from './protocol.js';

export type Rows = NonNullable<SplatRanges['rows']>;

/**
 * Properties of a shard that was read, without its splats, which have been distributed to cells. `count` is their
 * number.
 */
type Share = ReadShare & { readonly count: number };

export class PlyShares {
  readonly #name: string;
  readonly #rows: Rows;
  readonly #count: number;
  /** The shards that have been read, in the order of the file; undefined for the others. */
  readonly #shares: (Share | undefined)[];
  readonly #waiting = new Map<number, ReadShare>();
  /** The received bytes of the file. */
  bytes: Uint8Array = new Uint8Array();
  #layout: ShareLayout | undefined;
  #cells: ShareCells | undefined;
  /**
   * Index of the first shard whose splats have not been distributed to cells. Shards are distributed in the order of
   * the file.
   */
  #dealt = 0;

  /** @param count Number of splats in the file. */
  constructor(name: string, rows: Rows, count: number) {
    this.#name = name;
    this.#rows = rows;
    this.#count = count;
    this.#shares = new Array<undefined>(Math.ceil(count / SHARD_SPLATS));
  }

  get length(): number {
    return this.#shares.length;
  }

  /** Number of shards whose rows have been received completely. */
  get arrived(): number {
    const { start, byteLength } = this.#rows;
    const rows = Math.floor((this.bytes.length - start) / byteLength);
    return rows >= this.#count ? this.length : Math.max(0, Math.floor(rows / SHARD_SPLATS));
  }

  get areAllDealt(): boolean {
    return this.#dealt === this.length;
  }

  /** Number of usable splats in the shards that have been read. */
  get splats(): number {
    return this.#shares.reduce((sum, share) => sum + (share?.count ?? 0), 0);
  }

  /** Properties of the scene, from the first shard with usable splats; empty if there is none. */
  get facts(): Partial<Share> {
    return this.#shares.find((share) => share?.shDegree !== undefined) ?? {};
  }

  get layout(): ShareLayout | undefined {
    return this.#layout;
  }

  /**
   * Returns the layout that suits the splats of all shards. It may differ from {@link layout}, which the first shard
   * has determined.
   */
  layoutFor(sh: SceneRequest['sh']): ShareLayout {
    return this.#cells!.layoutFor(sh);
  }

  /** Returns the cells, and forgets them. Call after all shards are distributed. */
  takeCells(): ShareCell[] {
    const cells = this.#cells!.all();
    this.#cells = undefined;
    return cells;
  }

  /** Sets {@link layout} from the first received shard with usable splats, if it is not set yet. */
  async findLayout(sh: SceneRequest['sh']): Promise<void> {
    if (this.#layout || this.arrived === 0) return;
    const precision = sh === 'auto' ? 'int8' : sh;
    let layout: ShareLayout | undefined;
    for (let share = 0; share < this.arrived && !layout; share++)
      layout = await layoutBy(this.rowsOf(share), precision);
    this.#useLayout(layout);
  }

  /** Discards all shards that have been read, and starts again with a layout; undefined if it must be found again. */
  forget(layout: ShareLayout | undefined): void {
    this.#useLayout(layout);
    this.#shares.fill(undefined);
    this.#waiting.clear();
    this.#dealt = 0;
  }

  take(ticket: number, share: ReadShare): void {
    this.#waiting.set(ticket, share);
    for (let next = this.#waiting.get(this.#dealt); next; next = this.#waiting.get(++this.#dealt)) {
      if (next.packed) this.#cells!.add(next.packed);
      this.#shares[this.#dealt] = { ...next, packed: undefined, preview: undefined, count: next.packed?.count ?? 0 };
      this.#waiting.delete(this.#dealt);
    }
  }

  /**
   * Returns the rows of a shard after the file's header, as a truncated PLY.
   * @param share Index of the shard.
   * @param room Buffer for the result, used if it is large enough.
   */
  rowsOf(share: number, room?: ArrayBuffer): ShareRows {
    const { start, byteLength } = this.#rows;
    const end = Math.min(this.#count, SHARD_SPLATS * (share + 1));
    const rows = this.bytes.subarray(start + byteLength * SHARD_SPLATS * share, start + byteLength * end);
    const length = start + rows.length;
    const bytes = new Uint8Array(room && room.byteLength >= length ? room : new ArrayBuffer(length), 0, length);
    bytes.set(this.bytes.subarray(0, start));
    bytes.set(rows, start);
    return { bytes, name: this.#name };
  }

  #useLayout(layout: ShareLayout | undefined): void {
    this.#layout = layout;
    this.#cells = layout && new ShareCells(layout);
  }
}
