import { GaussianSplatError, loadModule, shCoefficientCount, type ShDegree } from '@gaussian-splat/core';
import { DEGREE_OF_REST_COUNT, type DraftCloud } from '../cloud.js';
import type { SceneSource } from '../scene-format.js';
import type { PlyElement, PlyHeader, PlyProperty } from './header.js';
import type * as meaning from './metadata.js';
import type { ColumnTarget } from './rows.js';

/** Layout of the splats in a PLY file, in the aspects that vary. */
export interface GaussianLayout {
  readonly vertex: PlyElement;
  /** Degree of the file's spherical harmonics. */
  readonly degree: ShDegree | 4;
  readonly opacity: PlyProperty;
  /** Properties of the constant color: SH coefficients, or plain colors to convert. */
  readonly color: readonly PlyProperty[];
  readonly colorIsSh: boolean;
  /** False for 2D Gaussians (2DGS): discs without a third axis. */
  readonly hasThirdScale: boolean;
  /** Mip-Splatting: sizes and opacities are those before its filter, whose width is stored for each splat. */
  readonly hasFilter: boolean;
}

const REQUIRED = ['x', 'y', 'z', 'scale_0', 'scale_1', 'rot_0', 'rot_1', 'rot_2', 'rot_3', 'opacity'];
const SH_COLOR = ['f_dc_0', 'f_dc_1', 'f_dc_2'];
const PLAIN_COLOR = ['red', 'green', 'blue'];

/** Finds the splats in a header. Throws `decode/not-splats` for meshes and point clouds, `decode/header` otherwise. */
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

/** Returns a header with the standard names: CloudCompare writes `scalar_opacity` for `opacity`. */
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
 * Degree of the spherical harmonics of an element with properties `f_rest_0`, `f_rest_1`, ...; their number is 3·((d +
 * 1)² - 1). Throws `decode/header` for any other number or a gap in the numbering.
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
 * Destinations of the properties `f_rest_*`. They hold the coefficients above the constant one channel by channel, red
 * first; a cloud interleaves the channels. `degree` is that of the file; bands above the cloud's degree are skipped.
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

/** Standard properties of splats up to degree 3, including packed ones; normals are ignored. */
export const PLAIN = /^(n?[xyz]|f_dc_\d|f_rest_([1-3]?\d|4[0-4])|opacity|(scale|rot)_\d|red|green|blue|packed_.*)$/;
/** Elements that change the meaning of the vertices, or that are drawn in addition. */
const ODD = /^(face|tristrips|codebook_centers)$/;
/** LAM stores offsets from a mesh instead of positions, and only the file name reveals it. */
export const OFFSETS = /offset\.ply$/i;

/** Loads the metadata reader for a header with more than plain splats; undefined for all others. */
export async function loadMetadata(
  { comments, elements }: PlyHeader,
  fileName: string,
): Promise<typeof meaning | undefined> {
  const isOdd = elements.some(
    ({ name, properties }) =>
      ODD.test(name) || (/^(vertex|sh)$/.test(name) && properties.some((own) => !PLAIN.test(own.name))),
  );
  const isFlat = elements.some(
    ({ name, properties }) => name === 'vertex' && !properties.some((own) => own.name === 'scale_2'),
  );
  if (comments.length === 0 && !isOdd && !isFlat && !OFFSETS.test(fileName)) return undefined;
  return importMeaning();
}

export const importMeaning = (): Promise<typeof meaning> =>
  loadModule('the code that reads what a PLY says of itself', () => import('./metadata.js'));

/** Element and property of SHARP's color space. */
export const COLOR_SPACE = 'color_space';

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
