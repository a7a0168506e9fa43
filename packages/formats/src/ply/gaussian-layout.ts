import { GaussianSplatError, loadModule, shCoefficientCount, type ShDegree } from '@gaussian-splat/core';
import { DEGREE_OF_REST_COUNT, type DraftCloud } from '../cloud.js';
import type { SceneSource } from '../scene-format.js';
import type { PlyElement, PlyHeader, PlyProperty } from './header.js';
import type * as meaning from './metadata.js';
import type { ColumnTarget } from './rows.js';

/** Properties of the splats in a PLY file that differ between files. */
export interface GaussianLayout {
  readonly vertex: PlyElement;
  /** Degree of the file's spherical harmonics. */
  readonly degree: ShDegree | 4;
  readonly opacity: PlyProperty;
  /** Properties of the constant color: red, green and blue. */
  readonly color: readonly PlyProperty[];
  /** Whether {@link color} has SH coefficients. If false, it has plain colors. */
  readonly colorIsSh: boolean;
  /** Whether splats have three scales. If false, they are 2D Gaussians (2DGS), which are discs. */
  readonly hasThirdScale: boolean;
  /**
   * Whether the file has the width of the 3D filter of Mip-Splatting for each splat. Its scales and opacities are then
   * those before filtering.
   */
  readonly hasFilter: boolean;
}

const REQUIRED = ['x', 'y', 'z', 'scale_0', 'scale_1', 'rot_0', 'rot_1', 'rot_2', 'rot_3', 'opacity'];
const SH_COLOR = ['f_dc_0', 'f_dc_1', 'f_dc_2'];
const PLAIN_COLOR = ['red', 'green', 'blue'];

/**
 * Returns the layout of the splats that a header describes.
 * @throws GaussianSplatError `decode/not-splats` if properties of splats are missing, as in meshes and point clouds;
 * `decode/header` for incomplete spherical harmonics.
 */
export function findGaussians(source: SceneSource, header: PlyHeader): GaussianLayout {
  const vertex = header.elements.find((element) => element.name === 'vertex');
  if (!vertex) throw notSplats(source, 'an element "vertex"', describeElements(header));
  const scalar = (name: string): PlyProperty | undefined =>
    vertex.properties.find((property) => property.name === name && !property.listCountType);
  const missing = REQUIRED.filter((name) => !scalar(name));
  const colorIsSh = SH_COLOR.every(scalar);
  const color = (colorIsSh ? SH_COLOR : PLAIN_COLOR).map(scalar).filter((property) => property !== undefined);
  if (color.length < 3) missing.push(...SH_COLOR);
  if (missing.length > 0) {
    const present = vertex.properties.map((property) => property.name).join(', ') || 'none';
    throw notSplats(
      source,
      'the properties of Gaussian splats in element "vertex"',
      `${describeElements(header)}; vertex lacks ${missing.join(', ')} and has ${clip(present)}`,
    );
  }
  const hasThirdScale = scalar('scale_2') !== undefined;
  const hasFilter = hasThirdScale && scalar('filter_3D') !== undefined;
  return {
    vertex,
    degree: shDegreeOf(source, vertex),
    opacity: scalar('opacity')!,
    color,
    colorIsSh,
    hasThirdScale,
    hasFilter,
  };
}

/** Returns a header without the prefix `scalar_` of property names, which CloudCompare adds, as in `scalar_opacity`. */
export function withPlainNames(header: PlyHeader): PlyHeader {
  const plain = ({ properties, ...element }: PlyElement): PlyElement => {
    const names = new Set(properties.map(({ name }) => name));
    const rename = (property: PlyProperty): PlyProperty => {
      const name = property.name.replace(/^scalar_/, '');
      return names.has(name) ? property : { ...property, name };
    };
    return { ...element, properties: properties.map(rename) };
  };
  return { ...header, elements: header.elements.map(plain) };
}

/**
 * Returns the degree d of the spherical harmonics of an element, which has 3·((d + 1)² - 1) properties `f_rest_0`,
 * `f_rest_1`, ... Throws `decode/header` for any other number of properties, or a gap in the numbering.
 */
export function shDegreeOf(source: SceneSource, element: PlyElement): ShDegree | 4 {
  const rest = element.properties.filter((property) => /^f_rest_\d+$/.test(property.name));
  const degree = DEGREE_OF_REST_COUNT.get(rest.length / 3);
  const scalars = new Set(rest.filter(({ listCountType }) => !listCountType).map(({ name }) => name));
  const isComplete = rest.every((_, k) => scalars.has(`f_rest_${k}`));
  if (degree !== undefined && isComplete) return degree;
  throw new GaussianSplatError('decode/header', {
    where: `${source.name}, PLY header, element "${element.name}"`,
    expected: '0, 9, 24, 45 or 72 properties f_rest_0, f_rest_1, ... without gaps (SH degree 0 to 4)',
    found: `${rest.length}${isComplete ? '' : ', with gaps in their numbers'}`,
    remedy: 'export the file again with a whole degree of spherical harmonics',
  });
}

/**
 * Returns the destinations of the properties `f_rest_*` in `cloud.sh`. The file has all coefficients of red, then of
 * green, then of blue; a cloud interleaves the channels. Bands above the degree of the cloud are skipped.
 * @param degree Degree of the file.
 */
export function harmonicTargets(degree: number, cloud: DraftCloud): ColumnTarget[] {
  const kept = shCoefficientCount(cloud.shDegree);
  const stored = (degree + 1) ** 2 - 1;
  const targets: ColumnTarget[] = [];
  for (let channel = 0; channel < 3; channel++) {
    for (let k = 1; k < kept; k++) {
      const property = `f_rest_${channel * stored + k - 1}`;
      targets.push({ property, array: cloud.sh, stride: 3 * kept, offset: 3 * k + channel });
    }
  }
  return targets;
}

/** Matches the standard properties of splats up to degree 3, including packed ones and normals, which are ignored. */
export const PLAIN = /^(n?[xyz]|f_dc_\d|f_rest_([1-3]?\d|4[0-4])|opacity|(scale|rot)_\d|red|green|blue|packed_.*)$/;
/** Matches elements of splats, plain and packed. Others may change their meaning, or other programs draw them, too. */
const OF_SPLATS = /^(vertex|sh|chunk)$/;
/** Matches the names of files in which LAM may store offsets from a mesh in place of positions. */
export const OFFSETS = /offset\.ply$/i;

/** Loads metadata.ts if a header has comments or more than plain splats. Resolves to undefined otherwise. */
export async function loadMetadata(
  { comments, elements }: PlyHeader,
  fileName: string,
): Promise<typeof meaning | undefined> {
  const isOdd = elements.some(
    ({ name, properties }) =>
      !OF_SPLATS.test(name) || (name !== 'chunk' && properties.some((own) => !PLAIN.test(own.name))),
  );
  const isFlat = elements.some(
    ({ name, properties }) => name === 'vertex' && !properties.some((own) => own.name === 'scale_2'),
  );
  if (comments.length === 0 && !isOdd && !isFlat && !OFFSETS.test(fileName)) return undefined;
  return importMeaning();
}

export const importMeaning = (): Promise<typeof meaning> =>
  loadModule('the code that reads the metadata of a PLY', () => import('./metadata.js'));

/** Matches elements after the splats, and their only property: the color space of SHARP, and a safe orbit. */
export const TRAILING = /^(color_space|safe_orbit_camera_.*)$/;

function notSplats(source: SceneSource, expected: string, found: string): GaussianSplatError {
  return new GaussianSplatError('decode/not-splats', {
    where: `${source.name}, PLY header`,
    expected,
    found,
    remedy: 'give a PLY of Gaussian splats, as trainers write it (point_cloud.ply), not a mesh or a point cloud',
  });
}

function describeElements({ elements }: PlyHeader): string {
  const isMesh = elements.some(({ name, count }) => name === 'face' && count > 0);
  const list = elements.map(({ name, count }) => `${count} ${name}`).join(', ') || 'no elements';
  return `${isMesh ? 'a mesh' : 'a PLY'} with ${clip(list)}`;
}

function clip(text: string): string {
  return text.length > 160 ? `${text.slice(0, 160)}...` : text;
}
