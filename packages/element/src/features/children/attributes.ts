/**
 * The attributes of `<splat-scene>` and `<splat-mesh>`. Each is defined once, as those of `<gaussian-splat>` in
 * ../attributes.ts. Properties of the same names accept numbers as well.
 */
import { bareKeyword, flag, read, text } from '../../viewer/attribute.js';
import { upGrammar } from '../../viewer/camera/grammar.js';
import type { GroupNames } from '../../shared/splat-groups.js';
import type { Numbers } from '../../sources/generator/values.js';
import {
  anglesGrammar,
  boxGrammar,
  opacityGrammar,
  pointGrammar,
  scaleGrammar,
} from '../../viewer/camera/placing-grammar.js';

/** Attributes that `<splat-scene>` and `<splat-mesh>` share. */
const PLACED = {
  /**
   * Same as on `<img>`: `use-credentials` sends cookies to other origins.
   * @default that of the `<gaussian-splat>`
   * @example crossorigin="use-credentials"
   */
  crossorigin: bareKeyword(['anonymous', 'use-credentials']),
  /**
   * Position of the child's origin: x y z in meters of viewer space (y up, right-handed), or with `m`, `cm`, `mm`. The
   * property takes `[x, y, z]` as well.
   * @default `0 0 0`
   * @example position="1m 0 -2m"
   */
  position: read<readonly [number, number, number], string | readonly number[] | null>(pointGrammar),
  /**
   * Angles about the x, y and z axes of viewer space, with `deg` or `rad`. z is applied first, then x, then y. The property takes `[x, y, z]` in radians
   * as well.
   * @default `0 0 0`
   * @example rotation="0 90deg 0"
   */
  rotation: read<readonly [number, number, number], string | readonly number[] | null>(anglesGrammar),
  /**
   * Scale: one factor, or one for each axis.
   * @default `1`
   * @example scale="0.5"
   */
  scale: read<readonly [number, number, number], string | number | readonly number[] | null>(scaleGrammar),
  /**
   * Visitors may click the child. It receives the pointer events `click`, `pointerover` and `pointerout`, which bubble
   * and have a property `hit`. `Tab` focuses it, and `Enter` clicks it. Name it with `aria-label`. `style="cursor: …"`
   * sets the cursor over it.
   * @example interactive
   */
  interactive: flag(),
  /**
   * Plays the child's animation automatically, on its own clock, as soon as it is shown. Playback does not start for
   * visitors who prefer reduced motion. A button stops it.
   * @example autoplay
   */
  autoplay: flag(),
  /**
   * Restarts the child's animation at its end, on its own clock.
   * @example loop
   */
  loop: flag(),
};

/** Attributes that give a child a clock of its own. */
export const CLOCK_ATTRIBUTES = ['autoplay', 'loop'] as const;

export const SCENE_ATTRIBUTES = {
  /**
   * URL of the scene: a file, a sequence, a clip, a streamed folder, or a generator. The property takes a `File` or `Blob` as well.
   * @example src="plant.spz"
   */
  src: text<string | Blob | null>(),
  ...PLACED,
  /**
   * The axis of the file that points up, as on `<gaussian-splat>`. The scene is rotated by it before it is placed.
   * @default that of the scene, else `-y`
   * @example up="y"
   */
  up: read(upGrammar),
  /**
   * Opacity of the scene, 0 to 1: that of an otherwise opaque surface. Rays that cross several surfaces show more of
   * it.
   * @default `1`
   * @example opacity="0.5"
   */
  opacity: read<number, string | number | null>(opacityGrammar),
  /**
   * Shows only the splats with centers in a box: x y z of its minimum corner, then of its maximum, in meters and in the
   * axes of the file.
   * @default all of them
   * @example crop="-1 -1 -1 1 1 1"
   */
  crop: read<readonly number[] | undefined, string | readonly number[] | null>(boxGrammar),
  /**
   * Reads the group of each splat from this property of a PLY, as on `<gaussian-splat>`.
   * @example groups="object_id"
   */
  groups: text(),
  /**
   * Names of groups by their numbers, as on `<gaussian-splat>`: JSON. The property takes the object as well.
   * @default the numbers
   * @example group-names='{"4": "chair"}'
   */
  groupNames: text<GroupNames | string | null>(),
  /**
   * Contract of a generator: a URL or its JSON. The property takes the object as well.
   * @default in the model or beside it
   * @example contract="walker.contract.json"
   */
  contract: text<string | object | null>(),
  /**
   * URLs of generators, separated by spaces. Each generator receives the Gaussians of the previous one.
   * @example chain="relight.onnx"
   */
  chain: text(),
  /**
   * Pose of a generator: numbers, flattened or as nested lists.
   * @default the rest pose
   * @example pose="0 0.3 0"
   */
  pose: text<Numbers | null>(),
};

export const MESH_ATTRIBUTES = {
  /**
   * URL of a glTF, GLB or PLY file. The property takes a `File` or `Blob` as well.
   * @example src="chair.glb"
   */
  src: text<string | Blob | null>(),
  ...PLACED,
};
