/** The rows of a large PLY in shards that can be packed independently, and the results. */
import type { SplatRanges } from '@gaussian-splat/formats';
import { SHARD_SPLATS, ShareCells, type ShareCell, type ShareLayout } from '@gaussian-splat/renderer/tools';
import { layoutBy, type ReadShare, type ShareRows } from './pack-shares.js';
import type { SceneRequest } from './protocol.js';

export type Rows = NonNullable<SplatRanges['rows']>;

/** A read shard. Its splats are in their cells. */
type Share = ReadShare & { readonly count: number };

export class PlyShares {
  readonly #name: string;
  readonly #rows: Rows;
  readonly #count: number;
  /** Read shards, in the order of the file; a cell contains consecutive ones. */
  readonly #shares: (Share | undefined)[];
  readonly #waiting = new Map<number, ReadShare>();
  /** Received part of the file. */
  bytes: Uint8Array = new Uint8Array();
  #layout: ShareLayout | undefined;
  #cells: ShareCells | undefined;
  /** Shards below this index are in their cells. */
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

  /** Number of completely received shards. */
  get arrived(): number {
    const { start, byteLength } = this.#rows;
    const rows = Math.floor((this.bytes.length - start) / byteLength);
    return rows >= this.#count ? this.length : Math.max(0, Math.floor(rows / SHARD_SPLATS));
  }

  get areAllDealt(): boolean {
    return this.#dealt === this.length;
  }

  /** Usable splats of the shards that have been read. */
  get splats(): number {
    return this.#shares.reduce((sum, share) => sum + (share?.count ?? 0), 0);
  }

  /** Properties of the whole scene from its shards. */
  get facts(): Partial<Share> {
    return this.#shares.find((share) => share?.shDegree !== undefined) ?? {};
  }

  get layout(): ShareLayout | undefined {
    return this.#layout;
  }

  /** The layout for the splats of all shards. */
  layoutFor(sh: SceneRequest['sh']): ShareLayout {
    return this.#cells!.layoutFor(sh);
  }

  /** Returns the cells, once all shards are distributed. */
  takeCells(): ShareCell[] {
    const cells = this.#cells!.all();
    this.#cells = undefined;
    return cells;
  }

  /** Derives it from the first shard that has splats. */
  async findLayout(sh: SceneRequest['sh']): Promise<void> {
    if (this.#layout || this.arrived === 0) return;
    const precision = sh === 'auto' ? 'int8' : sh;
    let layout: ShareLayout | undefined;
    for (let share = 0; share < this.arrived && !layout; share++)
      layout = await layoutBy(this.rowsOf(share), precision);
    this.#useLayout(layout);
  }

  /** Begins anew. */
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
   * The file's header and the rows of a shard: a PLY without its end.
   * @param room Memory for them, if it is large enough.
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
