/**
 * Reader of the metadata in the header of a PLY. This module is loaded only for files with comments, or with properties
 * that change the meaning of others.
 */
import { GaussianSplatError, loadModule, normalize, type Vector3 } from '@gaussian-splat/core';
import { asciiOf, grouped } from '../bytes.js';
import type { DraftCloud } from '../cloud.js';
import { addCredits, creditsOf } from '../credits.js';
import { DEGREE_4, FLAT, warn } from '../faults.js';
import { OFFSETS, PLAIN, TRAILING } from './gaussian-layout.js';
import { safeOrbit } from '../safe-orbit.js';
import { trainedOrder } from '../trained-order.js';
import type { PlyHeader } from './header.js';

/** Filter variance in px² with which Mip-Splatting and the mip mode of Brush train. */
export const MIP_VARIANCE = 0.1;

/** Matches a comment with the sort order of training, which is group 1. */
const SORTING = /^sort(?:ing)?_?(?:method|mode)\s*[:=]?\s*(\S+)$/i;
/** Matches sort orders per pixel: `pixel`, and the names in the settings of StopThePop. No known trainer writes one. */
const ORDERS_PIXELS = /^(per_?)?pixel|^(hierarchical|full_sort|k_?buffer)$/;

/**
 * Returns group 1 of the last comment that matches a key such as `Vertical Axis:`, in lower case; undefined if none
 * matches. The last comment applies in the tools that write them, too. White space is reduced to single spaces, because
 * the time of a match is quadratic in the length of white space.
 */
function valueOf(comments: readonly string[], key: RegExp): string | undefined {
  return comments
    .map((text) => key.exec(text.replace(/\s+/g, ' ').trim()))
    .findLast((match) => match !== null)?.[1]
    .trim()
    .toLowerCase();
}

/** Matches comments with a credit, which is group 1 or 2, or with a license, which is group 3. */
const CREDIT =
  /^\s*(?:(?:attribution|authors?|copyright|credits?)\s*[:=]\s*(.*)|(copyright\b.*)|licen[cs]e\s*[:=]\s*(.*))$/is;

/** Reads the credits in comments such as `author: Jane Doe` and `license: CC-BY-4.0`. Several of a kind are joined. */
function readCredits(cloud: DraftCloud, comments: readonly string[]): void {
  const matches = comments.map((text) => CREDIT.exec(text)).filter((match) => match !== null);
  if (matches.length === 0) return;
  const join = (groups: readonly number[]): string =>
    matches
      .flatMap((match) => groups.flatMap((group) => match[group] ?? []))
      .map(utf8Of)
      .join('; ');
  addCredits(cloud, creditsOf({ attribution: join([1, 2]), license: join([3]) }));
}

/** Bytes by the characters that `asciiOf` returns for them. */
const BYTES = new Map(Array.from(asciiOf(Uint8Array.from({ length: 256 }, (_, k) => k)), (char, k) => [char, k]));

/** Decodes a text of UTF-8 that was decoded as one character for each byte. Returns other texts as they are. */
function utf8Of(text: string): string {
  try {
    return new TextDecoder('utf-8', { fatal: true }).decode(Uint8Array.from(text, (char) => BYTES.get(char)!));
  } catch {
    return text;
  }
}

/** Sets the metadata of a cloud from comments: filter, sort order, direction up, credits, and the program that wrote the file. */
export function readComments(cloud: DraftCloud, comments: readonly string[]): void {
  const mode = valueOf(comments, /^splatrendermode\s*:\s*(.*)$/i);
  if (mode !== undefined) cloud.antialiased = mode === 'mip';
  else if (valueOf(comments, /^antialiased\s*[:=]?\s*(\S*)$/i) === '1') cloud.antialiased = true;
  const variance = Number(valueOf(comments, /^filter_variance\s*[:=]?\s*(\S+)$/i) ?? NaN);
  if (variance >= 0 && variance <= 1) cloud.filterVariance = variance;
  // The trainer of gsplat uses a filter variance of 0.3 px², the default.
  else if (mode === 'mip' && !comments.some((text) => /gsplat/i.test(text))) cloud.filterVariance = MIP_VARIANCE;
  const generator = valueOf(comments, /^((?:generated|exported|created) .*)$/i);
  const sorting = valueOf(comments, SORTING) ?? '';
  const order = ORDERS_PIXELS.test(sorting) ? 'pixel' : trainedOrder(sorting);
  if (order) cloud.hints = { ...cloud.hints, order };
  const up = upOf(comments);
  if (up) cloud.hints = { ...cloud.hints, up };
  readCredits(cloud, comments);
  if (generator !== undefined) cloud.hints = { ...cloud.hints, generator };
}

/**
 * Returns the unit direction up from a comment; undefined if there is none. An axis without a sign, such as `Vertical
 * Axis: z`, is +z in nerfstudio but -z in Brush. Brush also writes three numbers.
 */
function upOf(comments: readonly string[]): Vector3 | undefined {
  const text = valueOf(comments, /^vertical\s+axis\s*:\s*(.*)$/i);
  if (text === undefined) return undefined;
  const axis = /^([+-]?)([xyz])$/.exec(text);
  if (axis) {
    const isBrush = comments.some((comment) => /\bbrush\b/i.test(comment) || /^\s*Vertical axis/.test(comment));
    const sign = axis[1] === '-' || (axis[1] === '' && isBrush) ? -1 : 1;
    return ['x', 'y', 'z'].map((name) => (name === axis[2] ? sign : 0)) as unknown as Vector3;
  }
  const numbers = text.split(/[\s,]+/).map(Number);
  if (numbers.length !== 3) return undefined;
  const size = Math.hypot(...numbers);
  return size > 0 && Number.isFinite(size) ? normalize(numbers as unknown as Vector3) : undefined;
}

/**
 * Applies the 3D smoothing filter of Mip-Splatting in place: widens Gaussians and reduces their opacity (Yu et al. 2024,
 * section 4.1; `create_fused_ply` of its code).
 * @param filter [N] standard deviation of the filter for each splat, in units of the scene.
 */
export function fuseFilter(cloud: DraftCloud, filter: Float32Array): void {
  const { count, scales, opacities } = cloud;
  cloud.antialiased = true;
  cloud.filterVariance ??= MIP_VARIANCE;
  for (let i = 0; i < count; i++) {
    let share = 1;
    for (let k = 3 * i; k < 3 * i + 3; k++) {
      const wide = Math.hypot(scales[k], filter[i]);
      share *= wide > 0 ? scales[k] / wide : 1;
      scales[k] = wide;
    }
    opacities[i] *= share;
  }
}

/** Elements of Niantic's library with a safe orbit: two elevations, and a radius. */
const ELEVATIONS = 'safe_orbit_camera_elevation_min_max_radians';
const RADIUS = 'safe_orbit_camera_radius_min';

/**
 * Reads the elements that follow the splats: a safe orbit, and the color space of SHARP, 0 for sRGB and 1 for linear
 * RGB.
 * @param valuesOf Returns the values of an element whose only property has the same name.
 */
export async function readTrailing(
  cloud: DraftCloud,
  { elements }: PlyHeader,
  valuesOf: (name: string) => Float32Array,
): Promise<void> {
  const has = (wanted: string, rows: number): boolean =>
    elements.some(({ name, count }) => name === wanted && count === rows);
  if (has(ELEVATIONS, 2) && has(RADIUS, 1)) {
    const orbit = safeOrbit([...valuesOf(ELEVATIONS), ...valuesOf(RADIUS)]);
    if (orbit) cloud.hints = { ...cloud.hints, orbit };
    else warn(cloud, 'The limits of the camera are left out, because they are not the angles and radius of an orbit.');
  }
  if (!has('color_space', 1) || valuesOf('color_space')[0] !== 1) return;
  const { encodeLinearColors } = await loadModule(
    'the code that encodes linear colors',
    () => import('../linear-colors.js'),
  );
  encodeLinearColors(cloud, 'color_space 1 of SHARP');
}

/** Matches supported properties, and properties that do not affect drawing: labels and training statistics. */
const READ =
  /^(filter_3D|f_rest_\d+|alpha|(obj|sem|semantic|instance|label|class|object|segment|confidence|kl|id)(_.*)?)$/i;

/**
 * Matches supported elements, elements with a warning of their own, and elements that do not affect drawing: the camera
 * of the photograph in files of SHARP.
 */
const KNOWN = new RegExp(
  `${TRAILING.source}|^(vertex|sh|chunk|face|tristrips|extrinsic|intrinsic|image_size|frame|disparity|version)$`,
);

/** Adds warnings about content that is not drawn, or that may be misinterpreted. */
export function warnDropped(cloud: DraftCloud, { elements }: PlyHeader, fileName: string): void {
  const properties = (name: string): string[] =>
    elements
      .filter((element) => element.name === name)
      .flatMap((own) => own.properties.map((property) => property.name));
  const names = properties('vertex');
  if ([...names, ...properties('sh')].includes('f_rest_45')) warn(cloud, DEGREE_4);
  if (names.includes('scale_1') && !names.includes('scale_2')) warn(cloud, FLAT);
  const unread = names.filter((name) => !PLAIN.test(name) && !READ.test(name));
  if (unread.length > 0) {
    const listed = unread.slice(0, 6).join(', ') + (unread.length > 6 ? `, ... (${unread.length})` : '');
    warn(
      cloud,
      `Properties of splats that are not known are left out: ${listed}. If they move or recolor the splats, the frame differs from the training.`,
    );
  }
  const others = elements.filter(({ name, count }) => count > 0 && !KNOWN.test(name)).map(({ name }) => name);
  if (others.length > 0) warn(cloud, `Elements that are not known are left out: ${others.slice(0, 6).join(', ')}.`);
  for (const { name, count } of elements) {
    if (/^(face|tristrips)$/.test(name) && count > 0)
      warn(cloud, `${grouped(count)} rows of "${name}" are left out: only splats are drawn, not meshes.`);
  }
  if (OFFSETS.test(fileName))
    warn(
      cloud,
      'Files of this name by LAM hold offsets from a head mesh in place of positions. If this is one, export the positions (offset2xyz=False, rgb2sh=True).',
    );
}

/**
 * Adds a warning about numbers that may have been activated already. Trained scenes have negative logits, and splats
 * smaller than one unit.
 * @param hasLargeScales Whether no logarithm of a scale is below 0. All logits are in 0..1.
 */
export function noteActivated(cloud: DraftCloud, hasLargeScales: boolean): void {
  warn(
    cloud,
    hasLargeScales
      ? 'No scale_* is below 0 and all opacities are in 0..1, as if both were activated already; they are read as logarithms and logits, so that splats are too large and too pale. If the frame is wrong, export the logarithms of scales and the logits of opacities.'
      : 'All opacities are in 0..1, as if they were opacities already, which pixelSplat and MVSplat write; they are read as logits, so that all lie between 0.5 and 0.73. If the frame is wrong, export the logits.',
  );
}

/** Other kinds of splats with the same property names. `mark` matches a name that only this kind has. */
const OTHER_SPLAT_TYPES: readonly { readonly mark: RegExp; readonly found: string; readonly remedy: string }[] = [
  {
    mark: /^(trbf_center|motion_\d+|omega_\d+)$/,
    found: 'SpacetimeGaussians, which move and whose f_dc_* are plain colors',
    remedy: 'export each moment as a PLY of its own and show them as a sequence',
  },
  {
    mark: /^(f_anchor_feat_\d+|f_offset_\d+)$/,
    found: 'anchors of Scaffold-GS, from which a network makes splats for each view',
    remedy: 'export its network as a generator, or bake the splats of one view into a PLY',
  },
  {
    mark: /^binding_\d+$/,
    found: 'splats of GaussianAvatars, whose places are local to the triangles of a head mesh',
    remedy: 'export the splats of one pose as PLY, or a generator that holds the mesh',
  },
  {
    mark: /^codebook_centers$/,
    found: 'splats as reduced-3dgs compresses them',
    remedy: 'save the scene without quantization, or unpack it with the tools of reduced-3dgs, and give that PLY',
  },
];

/** Throws `decode/unsupported` if names show that properties have another meaning than in plain splats. */
export function refuseOtherMeanings(where: string, { elements }: PlyHeader): void {
  const names = elements.flatMap(({ name, properties }) => [name, ...properties.map((property) => property.name)]);
  for (const { mark, found, remedy } of OTHER_SPLAT_TYPES) {
    const marked = names.filter((name) => mark.test(name));
    if (marked.length === 0) continue;
    throw new GaussianSplatError('decode/unsupported', {
      where: `${where}, PLY header`,
      expected: 'plain Gaussian splats',
      found: `${found} (${marked.slice(0, 3).join(', ')})`,
      remedy,
    });
  }
}
