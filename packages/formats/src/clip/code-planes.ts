/** Model of the codes of motion: how a {@link BitCoder} codes planes by their neighbors in space and time. */
import { CodePredictor } from './code-predictor.js';
import { NumberModel } from './number-model.js';
import type { BitCoder } from './range-coder.js';

const [MIN_CODE, MAX_CODE] = [-32_768, 32_767];
const NOTHING = new Int16Array(0);

/** Planes that are coded before a plane, whose splats resemble those of the plane. Empty if there is none. */
export interface EarlierPlanes {
  /** Plane of the same curve for the previous number of the attribute, [splats]. */
  readonly number: Int16Array;
  /** Plane of the previous curve for the same number, [splats]. */
  readonly curve: Int16Array;
}

export const NO_PLANES: EarlierPlanes = { number: NOTHING, curve: NOTHING };

/** Properties of splats that the coder and the decoder know before the codes. */
export interface KnownSplats {
  /** [splats] 1 for splats that are absent from some frames, otherwise 0. Either kind has its own statistics. */
  readonly kinds: Uint8Array;
  /** [splats, 3] positions, about -4 to 4. */
  readonly places: Float64Array;
  /** [splats] 1 if a code of the splat was not 0 in an earlier plane of any attribute. {@link PlaneModel} sets it. */
  readonly isActive: Uint8Array;
}

/** Codes the planes of an attribute. */
export class PlaneModel {
  readonly #splats: KnownSplats;
  readonly #models: readonly KindModel[];
  /** [splats] running mean of the magnitudes of the coded differences of earlier planes. */
  readonly #rests: Uint16Array;

  constructor(splats: KnownSplats) {
    this.#splats = splats;
    this.#rests = new Uint16Array(splats.kinds.length);
    this.#models = [0, 1].map(() => new KindModel(splats.places));
  }

  /**
   * Codes a plane, [splats], in place.
   * @param isPredicted Whether codes are predicted from neighbors, so that only differences are coded.
   */
  code(coder: BitCoder, plane: Int16Array, earlier: EarlierPlanes, isPredicted: boolean): void {
    const { kinds, isActive } = this.#splats;
    const rests = this.#rests;
    for (const model of this.#models) model.begin();
    for (let i = 0; i < plane.length; i++) {
      const model = this.#models[kinds[i]];
      plane[i] = model.code(coder, plane[i], i, earlier, isPredicted, isActive[i], rests[i]);
      rests[i] = (rests[i] + 2 * model.rest) >>> 1;
      if (plane[i] !== 0) isActive[i] = 1;
    }
  }
}

/** Codes the splats of one kind as if no others were between them. */
class KindModel {
  /** Statistics of splats that were not active in earlier planes, and of others. */
  readonly #numbers = [new NumberModel(), new NumberModel()];
  readonly #predictor: CodePredictor;
  /** The last two codes of this kind. */
  #last = 0;
  #lastButOne = 0;
  /** Magnitude of the last coded difference, and of the one before. */
  rest = 0;
  #restBefore = 0;

  constructor(places: Float64Array) {
    this.#predictor = new CodePredictor(places);
  }

  begin(): void {
    this.#predictor.begin();
    this.#last = this.#lastButOne = this.rest = this.#restBefore = 0;
  }

  code(
    coder: BitCoder,
    given: number,
    i: number,
    { number, curve }: EarlierPlanes,
    isPredicted: boolean,
    isActive: number,
    then: number,
  ): number {
    const [a, b] = [number === NOTHING ? 0 : number[i], curve === NOTHING ? 0 : curve[i]];
    const expected = isPredicted ? bounded(this.#predictor.expect(i, this.#last, this.#lastButOne, a, b)) : 0;
    const signs = 4 + 3 * Math.sign(this.#last) + Math.sign(a);
    const near = 2 * this.rest + this.#restBefore;
    const rest = this.#numbers[isActive].code(coder, given - expected, near, then, signs);
    const value = bounded(expected + rest);
    if (isPredicted) this.#predictor.learn(value);
    this.#lastButOne = this.#last;
    this.#last = value;
    this.#restBefore = this.rest;
    this.rest = rest < 0 ? -rest : rest;
    return value;
  }
}

const bounded = (code: number): number => (code < MIN_CODE ? MIN_CODE : code > MAX_CODE ? MAX_CODE : code);
