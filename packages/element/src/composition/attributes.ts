/**
 * The attributes of `<splat-scene>` and `<splat-mesh>`, each in one place, as those of `<gaussian-splat>` in ../attributes.ts. Properties of the same names take numbers
 * as well.
 */
import { bareKeyword, flag, read, text, type Attribute } from '../attributes.js';
import { upGrammar } from '../camera/grammar.js';
import type { Numbers } from '../live/values.js';
import { anglesGrammar, boxGrammar, opacityGrammar, pointGrammar, scaleGrammar } from './grammar.js';

/** What both have. */
const PLACED = {
  /**
   * As of `<img>`: `use-credentials` sends cookies to other origins.
   * @default that of the `<gaussian-splat>`
   */
  crossorigin: bareKeyword(['anonymous', 'use-credentials']),
  /**
   * Where its origin is: x y z in metres of viewer space (y up, right-handed), or with `m`, `cm`, `mm`. The property takes `[x, y, z]`, too.
   * @default `0 0 0`
   */
  position: read<readonly [number, number, number], string | readonly number[] | null>(pointGrammar),
  /**
   * Angles about the x, y and z axes of viewer space with `deg` or `rad`: z is applied first, then x, then y. As a property `[x, y, z]` in radians, too.
   * @default `0 0 0`
   */
  rotation: read<readonly [number, number, number], string | readonly number[] | null>(anglesGrammar),
  /**
   * A factor, or one for each axis.
   * @default `1`
   */
  scale: read<readonly [number, number, number], string | number | readonly number[] | null>(scaleGrammar),
  /** Plays by itself, on a clock of its own, as soon as it is shown; not for visitors who want less motion; visitors can stop it. */
  autoplay: flag(),
  /** Starts again at the end, on a clock of its own. */
  loop: flag(),
};

export const SCENE_ATTRIBUTES = {
  /** URL of the scene: a file, a sequence, a streamed folder, or a generator. The property takes a `File` or `Blob` as well. */
  src: text<string | Blob | null>(),
  ...PLACED,
  /**
   * What points up in the scene's own frame, as of `<gaussian-splat>`: it is turned to the y axis before it is placed.
   * @default what the scene says, else `-y`
   */
  up: read(upGrammar),
  /**
   * Factor of the opacity of its splats, 0 to 1.
   * @default `1`
   */
  opacity: read<number, string | number | null>(opacityGrammar),
  /**
   * Shows only the splats whose centres lie in a box: x y z of its least corner, x y z of its greatest, in metres of the scene's own frame, as the file has it.
   * @default all of them
   */
  crop: read<readonly number[] | undefined, string | readonly number[] | null>(boxGrammar),
  /**
   * Contract of a generator: a URL, its JSON, or as a property the object.
   * @default in the model or beside it
   */
  contract: text<string | object | null>(),
  /** URLs, with spaces between them, of generators that each take the Gaussians of the one before. */
  chain: text(),
  /**
   * Pose of a generator, flattened or nested.
   * @default the rest pose
   */
  pose: text<Numbers | null>(),
};

export const MESH_ATTRIBUTES = {
  /** URL of a glTF or GLB file. The property takes a `File` or `Blob` as well. */
  src: text<string | Blob | null>(),
  ...PLACED,
};

/** The properties of a table. */
export type PropertiesOf<Table> = {
  -readonly [K in keyof Table]: Table[K] extends Attribute<infer P, unknown> ? P : never;
};
