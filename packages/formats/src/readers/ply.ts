import { shCoefficientCount, type GaussianCloud } from '@gaussian-splat/core';
import { allocateCloud, expInPlace, keptDegree, SH_C0, sigmoidInPlace, type DraftCloud } from '../cloud.js';
import {
  findGaussians,
  harmonicTargets,
  importMeaning,
  loadMetadata,
  withPlainNames,
  type GaussianLayout,
} from '../ply/gaussian-layout.js';
import { exceedsFloat32, parsePlyHeader, type PlyProperty } from '../ply/header.js';
import { relativePositions } from '../ply/positions.js';
import { openElement, readColumns, type ColumnTarget, type ElementData } from '../ply/rows.js';
import type { SceneSource } from '../scene-format.js';

/**
 * Reads the PLY files of 3D Gaussian Splatting trainers (`save_ply` in INRIA's `scene/gaussian_model.py`): opacities
 * are logits, scales logarithms, rotations (w, x, y, z), and `f_rest_*` holds all red coefficients of spherical
 * harmonics, then all green, then all blue.
 */
export async function readPly(source: SceneSource): Promise<GaussianCloud> {
  const header = withPlainNames(parsePlyHeader(source));
  const meaning = await loadMetadata(header, source.name);
  meaning?.refuseOtherMeanings(source.name, header);
  const layout = findGaussians(source, header);
  const data = openElement(source, header, 'vertex');
  const cloud = allocateCloud(data.element.count, keptDegree(layout.degree), source);
  meaning?.readComments(cloud, header.comments);
  meaning?.warnDropped(cloud, header, source.name);
  source.signal?.throwIfAborted();
  const filter = new Float32Array(layout.hasFilter ? cloud.count : 0);
  readAttributes(data, layout, cloud, filter);
  source.signal?.throwIfAborted();
  const white = layout.opacity.type.startsWith('float') ? undefined : whiteOf(layout.opacity);
  if (cloud.count >= MIN_TESTED && white === undefined && isWithin(cloud.opacities, 0, 1)) {
    const { noteActivated } = await importMeaning();
    noteActivated(cloud, isWithin(cloud.scales, 0, Infinity));
  }
  expInPlace(cloud.scales);
  if (!layout.hasThirdScale) flatten(cloud);
  if (white === undefined) sigmoidInPlace(cloud.opacities);
  else for (let i = 0; i < cloud.count; i++) cloud.opacities[i] /= white;
  if (layout.hasFilter) meaning?.fuseFilter(cloud, filter);
  if (!layout.colorIsSh) convertPlainColors(cloud, layout.color);
  // The rest of the file follows the splats.
  if (!source.isPrefix)
    await meaning?.readTrailing(cloud, header, (name) => valuesOf(openElement(source, header, name)));
  return cloud;
}

/** A few splats may have all logits in 0..1 by chance. */
const MIN_TESTED = 50;

/** Whether all values lie within bounds. For most arrays of logits or logarithms this ends at the first few. */
function isWithin(values: Float32Array, min: number, max: number): boolean {
  for (let i = 0; i < values.length; i++) if (!(values[i] >= min && values[i] <= max)) return false;
  return true;
}

/** Values of an element whose only property has the same name. */
function valuesOf(data: ElementData): Float32Array {
  const values = new Float32Array(data.element.count);
  readColumns(data, interleaved([data.element.name], values, 1));
  return values;
}

function readAttributes(data: ElementData, layout: GaussianLayout, cloud: DraftCloud, filter: Float32Array): void {
  const scales = ['scale_0', 'scale_1', 'scale_2'].slice(0, layout.hasThirdScale ? 3 : 2);
  const targets = [
    ...interleaved(scales, cloud.scales, 3),
    ...interleaved(['rot_0', 'rot_1', 'rot_2', 'rot_3'], cloud.rotations, 4),
    ...interleaved(['opacity'], cloud.opacities, 1),
    ...interleaved(
      layout.color.map(({ name }) => name),
      cloud.sh,
      3 * shCoefficientCount(cloud.shDegree),
    ),
    ...harmonicTargets(layout.degree, cloud),
    ...(layout.hasFilter ? interleaved(['filter_3D'], filter, 1) : []),
  ];
  const coordinates = ['x', 'y', 'z'];
  if (layout.vertex.properties.some(({ name, type }) => coordinates.includes(name) && exceedsFloat32(type))) {
    const world = new Float64Array(3 * cloud.count);
    readColumns(data, [...targets, ...interleaved(coordinates, world, 3)]);
    Object.assign(cloud, relativePositions(world));
  } else {
    readColumns(data, [...targets, ...interleaved(coordinates, cloud.positions, 3)]);
  }
}

/** Targets of properties that are adjacent in every row of an array. */
function interleaved(names: readonly string[], array: ColumnTarget['array'], stride: number): ColumnTarget[] {
  return names.map((property, offset) => ({ property, array, stride, offset }));
}

/** A 2D Gaussian has no extent along its third axis. */
function flatten(cloud: DraftCloud): void {
  for (let i = 0; i < cloud.count; i++) cloud.scales[3 * i + 2] = 0;
}

/** The integer that represents 1. */
const whiteOf = ({ type }: Pick<PlyProperty, 'type'>): number => (type === 'uint16' ? 65_535 : 255);

/** Converts colors 0..255 (integers; 16-bit ones 0..65535) or 0..1 (floats) to the constant SH coefficient. */
function convertPlainColors(cloud: DraftCloud, color: readonly PlyProperty[]): void {
  const stride = 3 * shCoefficientCount(cloud.shDegree);
  color.forEach(({ type }, channel) => {
    const white = type.startsWith('float') ? 1 : whiteOf({ type });
    for (let at = channel; at < cloud.sh.length; at += stride) cloud.sh[at] = (cloud.sh[at] / white - 0.5) / SH_C0;
  });
}
