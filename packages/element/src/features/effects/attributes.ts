/** Attributes of `<splat-cut>`. Each is defined once, like those of `<gaussian-splat>` in ../attributes.ts. */
import type { Vector3 } from '@gaussian-splat/core';
import { CUT_SHAPES } from '@gaussian-splat/renderer/modifiers';
import { read, text } from '../../viewer/attribute.js';
import {
  angleGrammar,
  keywordGrammar,
  numberGrammar,
  parseQuantity,
  METERS_PER_UNIT,
} from '../../viewer/camera/grammar.js';
import type { AttributeGrammar } from '../../viewer/camera/grammar.js';
import { anglesGrammar, pointGrammar, scaleGrammar } from '../../viewer/camera/placing-grammar.js';

type Numbers = string | number | readonly number[] | null;

/** Effect of a cut on the splats of its side. */
export type CutEffect = 'hide' | 'fade' | 'tint' | 'lighten' | 'recolor' | 'displace';

const colorGrammar: AttributeGrammar<Vector3> = {
  expected: 'a color of CSS, such as tomato or #ff6347',
  fallback: 'white',
  parse: parseColor,
};

let paper: CanvasRenderingContext2D | null | undefined;

/** Parses a CSS color. Returns red, green and blue, 0..1, sRGB-encoded; null if it is no color. */
function parseColor(text: string): Vector3 | null {
  // A canvas in CPU memory, because reading one on the GPU waits for the GPU at every change of a cut.
  paper ??= Object.assign(document.createElement('canvas'), { width: 1, height: 1 }).getContext('2d', {
    willReadFrequently: true,
  });
  if (!paper || !CSS.supports('color', text)) return null;
  paper.clearRect(0, 0, 1, 1);
  paper.fillStyle = text;
  paper.fillRect(0, 0, 1, 1);
  const [red, green, blue] = paper.getImageData(0, 0, 1, 1).data;
  return [red / 255, green / 255, blue / 255];
}

const edgeGrammar: AttributeGrammar<number | 'hard'> = {
  expected: '"soft", "hard", or a length such as 10cm',
  fallback: 'soft',
  parse: (text) => {
    const word = text.trim().toLowerCase();
    if (word === 'soft') return 0;
    if (word === 'hard') return word;
    const quantity = parseQuantity(word);
    const meters = quantity && METERS_PER_UNIT[quantity.unit];
    return meters && quantity.value >= 0 ? quantity.value * meters : null;
  },
};

export const CUT_ATTRIBUTES = {
  /**
   * `box`, `sphere`, `cylinder` with an upright axis, `plane`, or `everywhere`. The first three are 1 m wide and high
   * before `scale`. The inside of a plane is below it.
   * @default `box`; with `group` `everywhere`
   * @example shape="sphere"
   */
  shape: read<'box' | 'sphere' | 'cylinder' | 'plane' | 'everywhere'>(keywordGrammar(CUT_SHAPES)),
  /**
   * Names or numbers of groups, separated by commas: only their splats are inside. Needs the attribute `groups` of the scene.
   * @default all splats
   * @example group="chair, table"
   */
  group: text(),
  /**
   * Position of the center: x y z in meters of viewer space, or of the coordinates of its parent scene, y up. The
   * property takes `[x, y, z]` as well.
   * @default `0 0 0`
   * @example position="0 0.5m 0"
   */
  position: read<Vector3, Numbers>(pointGrammar),
  /**
   * Angles about the x, y and z axes, with `deg` or `rad`. z is applied first, then x, then y. The property takes `[x, y, z]` in radians as well.
   * @default `0 0 0`
   * @example rotation="0 0 30deg"
   */
  rotation: read<Vector3, Numbers>(anglesGrammar),
  /**
   * Width, height and depth in meters: one number, or one for each axis.
   * @default `1`
   * @example scale="2 1 2"
   */
  scale: read<Vector3, Numbers>(scaleGrammar),
  /**
   * Side of the shape whose splats change: `inside` or `outside`.
   * @default `inside`
   * @example side="outside"
   */
  side: read<'inside' | 'outside'>(keywordGrammar(['inside', 'outside'])),
  /**
   * `soft`: a splat at the edge changes by its fraction on that side. `hard`: it changes if its center is on that side. A length is the width of a softer edge.
   * @default `soft`
   * @example edge="10cm"
   */
  edge: read<number | 'hard', Numbers>(edgeGrammar),
  /**
   * Effect on the splats: `hide`; `fade`, to a translucent surface; `tint`, shades of `color`; `lighten`; `recolor`,
   * hues rotated by `hue`; `displace`, moved by `offset`.
   * @default `hide`
   * @example effect="tint"
   */
  effect: read<CutEffect>(keywordGrammar(['hide', 'fade', 'tint', 'lighten', 'recolor', 'displace'])),
  /**
   * Strength of the effect, 0 to 1. Below 0, `lighten` darkens.
   * @default `1`
   * @example amount="0.5"
   */
  amount: read<number, Numbers>(numberGrammar(1, -1, 'a number from -1 to 1', 1)),
  /**
   * Color of `tint`, as in CSS. White leaves shades of gray.
   * @default `white`
   * @example color="tomato"
   */
  color: read<Vector3>(colorGrammar),
  /**
   * Hue rotation of `recolor`, like `hue-rotate()` of CSS.
   * @default `180deg`
   * @example hue="90deg"
   */
  hue: read<number, Numbers>(angleGrammar('180deg')),
  /**
   * Displacement of `displace`: x y z in meters.
   * @default `0 0 0`
   * @example offset="0 20cm 0"
   */
  offset: read<Vector3, Numbers>(pointGrammar),
};
