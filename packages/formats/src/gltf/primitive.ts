import { shCoefficientCount, type GaussianCloud, type ShDegree } from '@gaussian-splat/core';
import { grouped } from '../bytes.js';
import { allocateCloud, SH_C0, type DraftCloud } from '../cloud.js';
import { damaged, warn } from '../faults.js';
import { isObject, show } from '../json.js';
import { readSpz } from '../readers/spz.js';
import { trainedOrder } from '../trained-order.js';
import { transformCloud } from '../transform/transform-cloud.js';
import type { Json } from './container.js';
import type { SceneSource, SplatRange } from '../scene-format.js';
import type { GltfDocument } from './document.js';

const EXTENSION = 'KHR_gaussian_splatting';
/** Names of the extension for SPZ: the name in drafts, and the later one. */
const SPZ_EXTENSIONS = [`${EXTENSION}_compression_spz_2`, `${EXTENSION}_compression_spz`];

/** Transform, row-major 3x4, from the axes of a cloud (right, down, forward) to those of SPZ in glTF (left, up, forward). */
const SPZ_TO_GLTF = [-1, 0, 0, 0, 0, -1, 0, 0, 0, 0, 1, 0];

/** Whether a primitive of a mesh has splats (`KHR_gaussian_splatting`). */
export function isSplats(primitive: unknown): primitive is Json {
  return isObject(primitive) && isObject(primitive.extensions) && isObject(primitive.extensions[EXTENSION]);
}

/**
 * Whether the splats of a primitive are in uncompressed accessors. An extension of the extension may also define a kernel
 * or a projection; `noteUnknown` reports those.
 */
export function isUncompressed(primitive: Json): boolean {
  const { extensions } = splatsOf(primitive);
  if (!isObject(extensions) || Object.keys(extensions).length === 0) return true;
  const isSpz = SPZ_EXTENSIONS.some((name) => isObject(extensions[name]));
  return !isSpz && isObject(primitive.attributes) && attributeIn(primitive.attributes, 'ROTATION') !== undefined;
}

const splatsOf = ({ extensions }: Json): Json => (extensions as Json)[EXTENSION] as Json;

/** Returns the number of splats of an uncompressed primitive, and the degree of their spherical harmonics. */
export function splatsIn(
  document: GltfDocument,
  { attributes }: Json,
  path: string,
): { count: number; shDegree: ShDegree } {
  const own = isObject(attributes) ? attributes : {};
  if (own.POSITION === undefined) document.fail(`${path}, attributes`, 'an attribute POSITION', Object.keys(own));
  return { count: document.accessorCount(own.POSITION), shDegree: degreeOf((name) => attributeIn(own, name)) };
}

/** Returns the accessor of an attribute of splats. Drafts of the extension have attributes such as _SCALE. */
const attributeIn = (attributes: Json, name: string): unknown =>
  attributes[`${EXTENSION}:${name}`] ?? attributes[`_${name}`];

/** Reads the stored scales and opacities of an uncompressed primitive. A missing attribute becomes an empty array. */
export async function shapesIn(
  document: GltfDocument,
  { attributes }: Json,
  path: string,
): Promise<Pick<GaussianCloud, 'scales' | 'opacities'>> {
  if (!isObject(attributes)) return document.fail(`${path}.attributes`, 'an object', attributes);
  const read = async (name: string): Promise<Float32Array> => {
    const index = attributeIn(attributes, name);
    return index === undefined ? new Float32Array(0) : (await document.readAccessor(index)).values;
  };
  return { scales: await read('SCALE'), opacities: await read('OPACITY') };
}

/**
 * Reads a primitive with `KHR_gaussian_splatting` into a cloud in the coordinates of its node. The caller converts scales
 * and opacities of an uncompressed primitive as `activationOf` finds, and colors if {@link hasLinearColors}.
 * @param path Path of the primitive in the JSON, for error messages.
 * @param range Range of splats of an uncompressed primitive to read; default all.
 */
export async function readPrimitive(
  document: GltfDocument,
  primitive: Json,
  path: string,
  source: Pick<SceneSource, 'budget' | 'signal'>,
  range?: SplatRange,
): Promise<DraftCloud> {
  const splats = splatsOf(primitive);
  const cloud = await readNumbers(document, primitive, path, source, range);
  noteUnknown(cloud, splats);
  const { extras } = splats;
  const order = isObject(extras) ? trainedOrder(extras.sortingMethod) : undefined;
  if (order) cloud.hints = { order };
  return cloud;
}

async function readNumbers(
  document: GltfDocument,
  primitive: Json,
  path: string,
  source: Pick<SceneSource, 'budget' | 'signal'>,
  range: SplatRange | undefined,
): Promise<DraftCloud> {
  const splats = splatsOf(primitive);
  const compression = isObject(splats.extensions) ? splats.extensions : {};
  const spz = SPZ_EXTENSIONS.map((name) => compression[name]).find(isObject);
  if (spz) return readCompressed(document, spz, path, source);
  if (!isUncompressed(primitive)) {
    throw unsupported(
      document,
      path,
      'splats that are not compressed, or compressed as SPZ',
      Object.keys(compression)[0],
    );
  }
  return readAttributes(document, primitive, path, range);
}

const LINEAR = 'lin_rec709_display';

/** Whether the colors of a primitive of splats are linear. */
export const hasLinearColors = (primitive: Json): boolean => splatsOf(primitive).colorSpace === LINEAR;

/** Supported values of the properties of the extension. The first value replaces unsupported ones. */
const KNOWN = {
  kernel: ['ellipse'],
  colorSpace: ['srgb_rec709_display', LINEAR],
  projection: ['perspective'],
  sortingMethod: ['cameraDistance'],
} as const;

/**
 * Adds a warning for each property with an unsupported value, which another extension defines. Files that require such an
 * extension have already been rejected.
 */
function noteUnknown(cloud: DraftCloud, splats: Json): void {
  for (const [property, known] of Object.entries(KNOWN)) {
    const value = splats[property];
    if (value !== undefined && !(known as readonly unknown[]).includes(value))
      warn(cloud, `The ${property} ${show(value)} of splats is not known; "${known[0]}" is drawn in its place.`);
  }
}

function unsupported(document: GltfDocument, path: string, expected: string, found: string): Error {
  return damaged(`${document.name}, ${path}, ${EXTENSION}`, expected, found, 'decode/unsupported');
}

async function readCompressed(
  document: GltfDocument,
  { bufferView }: Json,
  path: string,
  { budget, signal }: Pick<SceneSource, 'budget' | 'signal'>,
): Promise<DraftCloud> {
  const bytes = await document.readView(bufferView);
  const cloud: DraftCloud = await readSpz({
    bytes,
    name: `${document.name}, ${path}, SPZ`,
    budget,
    signal,
    isWithinGltf: true,
  });
  transformCloud(cloud, SPZ_TO_GLTF);
  return cloud;
}

async function readAttributes(
  document: GltfDocument,
  primitive: Json,
  path: string,
  range: SplatRange | undefined,
): Promise<DraftCloud> {
  const attributes = isObject(primitive.attributes) ? primitive.attributes : {};
  const own = (name: string): unknown => attributeIn(attributes, name);
  const { count: all } = splatsIn(document, primitive, path);
  const count = range ? range.end - range.first : all;
  const read = async (name: string, index: unknown, width: number): Promise<Float32Array> => {
    if (index === undefined)
      return document.fail(`${path}, attributes`, `an attribute ${name}`, Object.keys(attributes));
    const data = await document.readAccessor(index, range, index === attributes.POSITION ? 0 : all);
    if (data.count !== all || data.width !== width) {
      const found = `${grouped(data.count)} of ${data.width} numbers`;
      return document.fail(`${path}, ${name}`, `${grouped(all)} of ${width} numbers`, found);
    }
    return data.values;
  };
  // Positions are read first, so that a file that is too short for them fails before the cloud is allocated.
  const positions = await read('POSITION', attributes.POSITION, 3);
  const cloud = allocateCloud(count, degreeOf(own), document);
  cloud.positions.set(positions);
  cloud.scales.set(await read('SCALE', own('SCALE'), 3));
  const opacity = own('OPACITY');
  if (opacity !== undefined || attributes.COLOR_0 === undefined) cloud.opacities.set(await read('OPACITY', opacity, 1));
  else setAlphas(cloud, await read('COLOR_0', attributes.COLOR_0, 4));
  toWFirst(await read('ROTATION', own('ROTATION'), 4), cloud.rotations);
  await readColors(cloud, own, attributes, read);
  return cloud;
}

function degreeOf(own: (name: string) => unknown): ShDegree {
  const bands = [1, 2, 3] as const;
  return bands.findLast((degree) => own(`SH_DEGREE_${degree}_COEF_0`) !== undefined) ?? 0;
}

/** Sets opacities from the alpha of colors, [N, 4]: some drafts of the extension have no other opacities. */
function setAlphas({ opacities }: DraftCloud, colors: Float32Array): void {
  for (let i = 0; i < opacities.length; i++) opacities[i] = colors[4 * i + 3];
}

/** Copies quaternions (x, y, z, w), as in glTF, to (w, x, y, z), as in clouds. */
function toWFirst(source: Float32Array, out: Float32Array): void {
  for (let i = 0; i < out.length; i += 4) {
    out[i] = source[i + 3];
    for (let k = 0; k < 3; k++) out[i + 1 + k] = source[i + k];
  }
}

async function readColors(
  cloud: DraftCloud,
  own: (name: string) => unknown,
  attributes: Json,
  read: (name: string, index: unknown, width: number) => Promise<Float32Array>,
): Promise<void> {
  const stride = 3 * shCoefficientCount(cloud.shDegree);
  const put = (values: Float32Array, coefficient: number, width: number, shift = 0, scale = 1): void => {
    for (let i = 0; i < cloud.count; i++) {
      for (let k = 0; k < 3; k++) cloud.sh[i * stride + 3 * coefficient + k] = (values[i * width + k] + shift) * scale;
    }
  };
  const constant = own('SH_DEGREE_0_COEF_0');
  if (constant !== undefined || attributes.COLOR_0 === undefined)
    put(await read('SH_DEGREE_0_COEF_0', constant, 3), 0, 3);
  else put(await read('COLOR_0', attributes.COLOR_0, 4), 0, 4, -0.5, 1 / SH_C0);
  for (let degree = 1; degree <= cloud.shDegree; degree++) {
    for (let k = 0; k < 2 * degree + 1; k++) {
      const name = `SH_DEGREE_${degree}_COEF_${k}`;
      put(await read(name, own(name), 3), degree * degree + k, 3);
    }
  }
}
