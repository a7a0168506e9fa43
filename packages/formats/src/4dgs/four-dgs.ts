/** Reader of `.4dgs` files, whose splats appear, move and fade: https://github.com/avala-ai/4dgs. */
import type { GaussianCloud, ShDegree, Vector3 } from '@gaussian-splat/core';
import { concatenated } from '@gaussian-splat/core/fetch';
import { LoadBudget, type LoadLimits } from '../budget.js';
import { damaged } from '../faults.js';
import { ATTRIBUTE, type AttributeId } from './streams.js';
import { chainOf, chunksOf, rowsById, stateOf, type Chunk, type KnownState, type State } from './chunks.js';
import { presence, splatsFrom, type ChangingSplats, type Scene } from './splats.js';
import { poseAt, product, readTrack, turnedPoint, type ObjectTrack } from './tracks.js';
import { Cursor, OPCODE, readGrids, readHeader, readUp, readWindows, recordsOf } from './wire.js';

/** Distance from which the origin of the grid becomes the origin of the scene, so that float32 positions are precise. */
const FAR = 1000;
/** Maximum number of decoded populations in the cache, because consecutive frames need the same ones. */
const MAX_STATES = 4;

/** Splats of a time or a range of time, and their ids. */
export interface Population {
  readonly splats: ChangingSplats;
  /** Id of each splat, [count], which identifies the splat in other populations. Absent without deltas. */
  readonly ids?: Int32Array | undefined;
}

/** An opened `.4dgs` file. Its chunks are decoded on demand. */
export class FourDgs {
  readonly scene: Scene;
  readonly chunks: readonly Chunk[];
  readonly tracks: ReadonlyMap<number, ObjectTrack>;
  readonly up: Vector3 | undefined;
  readonly origin: Vector3;
  readonly byteLength: number;
  readonly #limits: LoadLimits;
  readonly #states = new Map<string, Promise<Population>>();
  /** For each chunk of a file with deltas, the index of the next keyframe after it; -1 if there is none. */
  #nextKeyframes: Int32Array | undefined;
  /** The last state that {@link keyedPopulation} decoded. */
  #latest: KnownState | undefined;

  /**
   * Reads the header records of a file, and the heads of its chunks.
   * @throws GaussianSplatError `decode/header`, `decode/truncated`, `decode/corrupt`, `decode/unsupported`, `out-of-memory/budget`
   */
  constructor(bytes: Uint8Array, name: string, limits: LoadLimits = {}) {
    const records = recordsOf(bytes, name);
    const find = (opcode: number): Cursor | undefined => {
      const record = records.find((own) => own.opcode === opcode);
      return record && new Cursor(record.content, name);
    };
    const header = readHeader(find(OPCODE.header)!);
    const grids = find(OPCODE.quantization);
    if (!grids) throw damaged(name, 'a record of quantization', 'none', 'decode/header');
    const windows = find(OPCODE.windows);
    this.scene = { header, grids: readGrids(grids), windows: windows ? readWindows(windows) : [], name };
    this.chunks = chunksOf(records, header.model, name);
    new LoadBudget(bytes.length, limits).takeSplats(header.splats, header.shDegree, name);
    this.tracks = tracksOf(
      records.filter(({ opcode }) => opcode === OPCODE.objectTrack),
      name,
    );
    const frame = find(OPCODE.frame);
    this.up = frame && readUp(frame);
    const { origin } = this.scene.grids;
    this.origin = Math.hypot(...origin) > FAR ? origin : [0, 0, 0];
    this.byteLength = bytes.length;
    this.#limits = limits;
  }

  get isKeyed(): boolean {
    return this.scene.header.model === 'keyframe-delta';
  }

  /** Returns the index of the first chunk that ends after a time in seconds; the last chunk if none does. */
  stateAt(seconds: number): number {
    if (this.isKeyed) return Math.min(this.chunks.length - 1, this.#firstEndingAfter(seconds));
    const next = this.chunks.findIndex(({ until }) => seconds < until);
    return next < 0 ? this.chunks.length - 1 : next;
  }

  /** Binary search, because the chunks of a file with deltas follow each other without gaps. */
  #firstEndingAfter(seconds: number): number {
    let [low, high] = [0, this.chunks.length];
    while (low < high) {
      const middle = (low + high) >> 1;
      if (seconds < this.chunks[middle].until) high = middle;
      else low = middle + 1;
    }
    return low;
  }

  /** Returns the index of the first keyframe after a chunk; -1 if there is none. */
  keyframeAfter(chunk: number): number {
    if (this.#nextKeyframes === undefined) {
      this.#nextKeyframes = new Int32Array(this.chunks.length);
      for (let k = this.chunks.length - 1, next = -1; k >= 0; k--) {
        this.#nextKeyframes[k] = next;
        if (this.chunks[k].reference === undefined) next = k;
      }
    }
    return this.#nextKeyframes[chunk] ?? -1;
  }

  /** Returns a new account for decoding one group of frames. */
  budget(): LoadBudget {
    return new LoadBudget(this.byteLength, this.#limits);
  }

  /** Returns the indices of the chunks whose splats may be visible within a range of seconds. */
  chunksWithin(from: number, until: number): number[] {
    if (this.isKeyed) {
      const found: number[] = [];
      for (let k = this.#firstEndingAfter(from); k < this.chunks.length && this.chunks[k].from <= until; k++)
        found.push(k);
      return found;
    }
    return [...this.chunks.keys()].filter((k) => this.chunks[k].from <= until && from < this.chunks[k].until);
  }

  /** Decodes the splats of some chunks, by their indices. The file must not have deltas. */
  population(chunks: readonly number[]): Promise<Population> {
    return this.#kept(`${chunks}`, async (decoding) => {
      const states = await Promise.all(chunks.map((k) => stateOf(this.chunks, [k], decoding)));
      const state = mergedStates(states, decoding.shDegree);
      takeSplats(state, decoding);
      return { splats: splatsFrom(...parts(state), this.scene) };
    });
  }

  /** Decodes the splats of a chunk, by its index, after all deltas that lead to its state. */
  keyedPopulation(chunk: number): Promise<Population> {
    return this.#kept(`to ${chunk}`, async (decoding) => {
      // During playback, each state is one delta after the last one.
      const state = await stateOf(this.chunks, chainOf(this.chunks, chunk), decoding, this.#latest);
      this.#latest = { chunk, state };
      const { name } = this.scene;
      takeSplats(state, decoding);
      const ids = Int32Array.from(rowsById(state.bins, name).keys());
      return { splats: splatsFrom(...parts(state), this.scene), ids };
    });
  }

  /**
   * Returns the visible splats at a time in seconds, as section 3 of the specification defines.
   * @throws GaussianSplatError as the constructor does
   */
  async cloudAt(seconds: number): Promise<GaussianCloud> {
    const within = this.chunksWithin(seconds, seconds);
    const { splats } = await (this.isKeyed ? this.keyedPopulation(this.stateAt(seconds)) : this.population(within));
    const { cutoff } = this.scene.header;
    const rows = [...Array(splats.count).keys()].filter((i) => presence(splats, i, seconds, cutoff) > 0);
    return this.cloudOf(splats, rows, seconds);
  }

  /** Returns a cloud of the given rows at a time in seconds. Rows that are invisible at that time have opacity 0. */
  cloudOf(splats: ChangingSplats, rows: readonly number[], seconds: number): GaussianCloud {
    const { shDegree, cutoff } = this.scene.header;
    const pick = (values: Float32Array, width: number): Float32Array => {
      const own = new Float32Array(width * rows.length);
      rows.forEach((row, k) => own.set(values.subarray(width * row, width * (row + 1)), width * k));
      return own;
    };
    const positions = new Float32Array(3 * rows.length);
    const rotations = pick(splats.rotations, 4);
    rows.forEach((row, k) => this.#place(splats, row, seconds, positions.subarray(3 * k), rotations.subarray(4 * k)));
    return {
      ...{
        count: rows.length,
        shDegree,
        origin: this.origin,
        positions,
        rotations,
        antialiased: false,
        droppedCount: 0,
      },
      scales: pick(splats.scales, 3),
      opacities: Float32Array.from(rows, (row) => splats.opacities[row] * presence(splats, row, seconds, cutoff)),
      sh: pick(splats.sh, splats.count > 0 ? splats.sh.length / splats.count : 3),
      ...(this.up && { hints: { up: this.up } }),
    };
  }

  /** Writes position and rotation of a splat at a time in seconds: first its own motion, then that of its object. */
  #place(splats: ChangingSplats, row: number, seconds: number, position: Float32Array, rotation: Float32Array): void {
    const { grids } = this.scene;
    const elapsed = seconds - splats.centers[row];
    const point = [0, 1, 2].map(
      (k) => splats.positions[3 * row + k] + grids.origin[k] + splats.velocities[3 * row + k] * elapsed,
    );
    const track = this.tracks.get(splats.objects[row]);
    const pose = track && poseAt(track, seconds);
    const placed = pose ? turnedPoint(pose.rotation, point).map((value, k) => value + pose.translation[k]) : point;
    for (let k = 0; k < 3; k++) position[k] = placed[k] - this.origin[k];
    if (pose) rotation.set(product(pose.rotation, Array.from(rotation.subarray(0, 4))));
  }

  #kept(
    key: string,
    decode: (decoding: { name: string; budget: LoadBudget; shDegree: ShDegree }) => Promise<Population>,
  ): Promise<Population> {
    const { name, header } = this.scene;
    const found = this.#states.get(key);
    this.#states.delete(key);
    const asked =
      found ?? decode({ name, budget: new LoadBudget(this.byteLength, this.#limits), shDegree: header.shDegree });
    this.#states.set(key, asked);
    for (const [oldest] of this.#states) if (this.#states.size > MAX_STATES) this.#states.delete(oldest);
    return asked;
  }
}

/** Bytes of the changes over time and the id of a splat, besides those of a cloud. */
const CHANGES_BYTES = 64;

/** Charges the splats that a state is converted to. */
function takeSplats({ bins }: State, decoding: { name: string; budget: LoadBudget; shDegree: ShDegree }): void {
  const count = bins.get(ATTRIBUTE.flags)?.length ?? 0;
  decoding.budget.takeSplats(count, decoding.shDegree, decoding.name);
  decoding.budget.take(CHANGES_BYTES * count, decoding.name);
}

const parts = ({ bins, bands }: State): [State['bins'], State['bands']] => [bins, bands];

function tracksOf(records: readonly { content: Uint8Array }[], name: string): Map<number, ObjectTrack> {
  const tracks = new Map<number, ObjectTrack>();
  for (const { content } of records) {
    const track = readTrack(new Cursor(content, name));
    if (tracks.has(track.object)) throw damaged(name, 'one track of an object', `two of ${track.object}`);
    if (track.samples.length > 0) tracks.set(track.object, track);
  }
  return tracks;
}

/** Concatenates the states of chunks that have no splat in common. */
function mergedStates(states: readonly State[], shDegree: number): State {
  if (states.length === 1) return states[0];
  const ids = new Set(states.flatMap(({ bins }) => [...bins.keys()]));
  const count = (state: State): number => state.bins.get(ATTRIBUTE.flags)?.length ?? 0;
  const bins = new Map<AttributeId, Int32Array>();
  for (const id of ids) {
    const width = states.reduce(
      (max, s) => Math.max(max, count(s) > 0 ? (s.bins.get(id)?.length ?? 0) / count(s) : 0),
      1,
    );
    const own = states.map((state) => state.bins.get(id) ?? new Int32Array(width * count(state)));
    bins.set(id, concatenated(Int32Array, own));
  }
  if (states.length === 0) for (const id of Object.values(ATTRIBUTE)) bins.set(id, new Int32Array(0));
  const bandOf = (_: unknown, k: number): Int32Array =>
    concatenated(
      Int32Array,
      states.map(({ bands }) => bands[k]),
    );
  const bands = Array.from({ length: shDegree }, bandOf);
  return { bins, bands };
}
