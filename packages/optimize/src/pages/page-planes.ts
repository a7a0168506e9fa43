import { concatenated } from '@gaussian-splat/core/fetch';
import { DIFFERENCES, headBytes, PLAIN, PLANES, planesOf, type SplatLevel } from '@gaussian-splat/renderer/tools';

/** Compresses bytes to a section of a raw deflate stream. A sync flush ends it, so that sections can be concatenated. */
export type Deflate = (bytes: Uint8Array) => Uint8Array;

/** Content of a file's planes. Each plane has a byte of each splat, in the order of the file. */
export class Planes {
  readonly bytes: Uint8Array[];
  count = 0;
  #classed = 0;
  #lower: readonly [count: number, classed: number] = [0, 0];

  constructor(splats: number, degree: SplatLevel['shDegree']) {
    this.bytes = Array.from({ length: planesOf(degree) }, () => new Uint8Array(splats));
  }

  put(plane: number, value: number): void {
    this.bytes[plane][this.count] = value & 255;
  }

  /** Appends the coefficients above the constant one of a splat whose class is above 0. */
  putHarmonics(codes: Int8Array): void {
    codes.forEach((code, k) => (this.bytes[PLANES.harmonics + k][this.#classed] = code & 255));
    this.#classed++;
  }

  /** Marks the start of the finer level, after the splats of the coarser level. */
  beginLower(): void {
    this.#lower = [this.count, this.#classed];
  }

  /** Planes, and the offset of the finer level in each. Planes of harmonics have only splats with a class above 0. */
  get whole(): { plane: Uint8Array; lower: number }[] {
    const [all, classed] = this.#lower;
    return this.bytes.map((plane, k) =>
      k < PLANES.harmonics ? { plane, lower: all } : { plane: plane.subarray(0, this.#classed), lower: classed },
    );
  }
}

/**
 * Returns the bytes in front of the planes: the number of splats of each chunk less 1, then the floats in byte planes.
 * The coding of each plane at the end remains 0 until {@link joined} sets it.
 */
export function headOf(
  counts: readonly number[],
  floats: Float32Array,
  file: Parameters<typeof headBytes>[0],
): Uint8Array {
  const head = new Uint8Array(headBytes(file));
  head.set(counts.map((count) => count - 1));
  const words = new Uint32Array(floats.buffer);
  words.forEach((word, k) => {
    for (let byte = 0; byte < 4; byte++) head[counts.length + byte * words.length + k] = word >>> (8 * byte);
  });
  return head;
}

/** Empty last block of a deflate stream. */
const END = Uint8Array.of(3, 0);

/** Returns the file with a head and planes. Sets the coding of each plane at the end of `head`. */
export function joined(head: Uint8Array, { whole: planes }: Planes, deflate: Deflate): Uint8Array<ArrayBuffer> {
  const runs = new Runs(deflate);
  planes.forEach(({ plane, lower }, k) => {
    const differences = plane.map((byte, i) => byte - (i > 0 ? plane[i - 1] : 0));
    const [plain, changed] = [plane, differences].map((bytes) => partsOf(bytes, lower, deflate));
    const mode = lengthOf(changed) < lengthOf(plain) ? DIFFERENCES : PLAIN;
    head[head.length - planes.length + k] = mode;
    (mode === PLAIN ? plain : changed).forEach((part) => runs.add(part));
  });
  return concatenated(Uint8Array, [deflate(head), ...runs.pieces, END]);
}

/** Bytes, and their compressed section. */
interface Piece {
  readonly bytes: Uint8Array;
  readonly deflated: Uint8Array;
}

const pieceOf = (bytes: Uint8Array, deflate: Deflate): Piece => ({ bytes, deflated: deflate(bytes) });

const lengthOf = (pieces: readonly Piece[]): number => pieces.reduce((sum, { deflated }) => sum + deflated.length, 0);

/** Compresses a plane to one section, or to two sections, divided at byte `at`, if these are smaller. */
function partsOf(bytes: Uint8Array, at: number, deflate: Deflate): Piece[] {
  const whole = [pieceOf(bytes, deflate)];
  if (at === 0 || at === bytes.length) return whole;
  const parts = [bytes.subarray(0, at), bytes.subarray(at)].map((part) => pieceOf(part, deflate));
  return lengthOf(parts) < lengthOf(whole) ? parts : whole;
}

/** List of sections. A section is joined with the last one if together they compress better. */
class Runs {
  readonly #deflate: Deflate;
  readonly #runs: Piece[] = [];

  constructor(deflate: Deflate) {
    this.#deflate = deflate;
  }

  add(piece: Piece): void {
    const last = this.#runs.at(-1);
    const both = last && pieceOf(concatenated(Uint8Array, [last.bytes, piece.bytes]), this.#deflate);
    if (both && both.deflated.length < lengthOf([last, piece])) this.#runs[this.#runs.length - 1] = both;
    else this.#runs.push(piece);
  }

  get pieces(): Uint8Array[] {
    return this.#runs.map(({ deflated }) => deflated);
  }
}
