import { loadModule, type GaussianCloud, type ShDegree } from '@gaussian-splat/core';
import { grouped, startsWith } from '../bytes.js';
import { allocateCloud, DEGREE_OF_REST_COUNT, type DraftCloud } from '../cloud.js';
import { addCredits } from '../credits.js';
import { damaged, FLAT, warn } from '../faults.js';
import { previewWanted, type OpenFile, type SceneSource } from '../scene-format.js';
import { PREVIEW_STEP, sparse } from '../preview.js';
import type { WebpImage } from '../webp/decode.js';
import { parseSogMeta, type SogMeta } from './meta.js';
import { Planes } from './planes.js';
import {
  PALETTE_ROW,
  unpackColors,
  unpackHarmonics,
  unpackMeans,
  unpackQuats,
  unpackScales,
  type Palette,
  type Selection,
} from './unpack.js';

/**
 * Maximum number of splats for each byte of the images. Without this limit, a file of 200 bytes could declare a thousand
 * million splats, because images of a single color are tiny. Real scenes need 3 bytes or more for each splat.
 */
const MAX_SPLATS_PER_BYTE = 16;
const FREE_SPLATS = 65_536;
/** Number of pixels of the largest palette: 1024 rows of 64 entries of 15 coefficients. */
const MAX_PALETTE_PIXELS = 1024 * PALETTE_ROW * 15;

interface GeometryPlanes {
  readonly low: Uint32Array;
  readonly high: Uint32Array;
  readonly scales: Uint32Array;
  readonly quats: Uint32Array;
  readonly sh0: Uint32Array;
}

/**
 * Reads the images that a `meta.json` names, and returns the splats.
 * @param open Opens images by their paths relative to the `meta.json`.
 */
export async function readSogImages(meta: SogMeta, open: OpenFile, source: SceneSource): Promise<GaussianCloud> {
  const { name } = source;
  const images = new Planes(open, source);
  const { count } = meta;
  // The download of coefficients starts at once, but they are decoded after the images of a preview.
  const harmonics = meta.shN?.files.slice(0, 2).map((file) => images.load(file));
  // Prevents an unhandled rejection if another image fails before these promises are awaited.
  harmonics?.forEach((file) => file.catch(() => undefined));
  const planes = await decodeGeometry(images, meta, name);
  if (previewWanted(source, count))
    await source.onPreview?.(sparse(unpackGeometry(planes, meta, PREVIEW_STEP, 0, source)));
  if (!meta.shN || !harmonics) return unpackGeometry(planes, meta, 1, 0, source);
  const palette = await images.decode(await harmonics[0], meta.shN.files[0], MAX_PALETTE_PIXELS);
  const degree = checkDegree(meta, palette.width, name);
  const labels = await images.decodePlane(await harmonics[1], meta.shN.files[1], count);
  const cloud = unpackGeometry(planes, meta, 1, degree, source);
  unpackHarmonics(labels, paletteOf(meta.shN, palette), cloud);
  return cloud;
}

/**
 * Reads a SOG of a streamed scene, from its `meta.json` or from a bundle of all of its files.
 * @param open Opens files by their paths relative to the `meta.json`.
 */
export async function readSogPart(source: SceneSource, open: OpenFile): Promise<GaussianCloud> {
  if (startsWith(source.bytes, 'PK\x03\x04')) {
    const { openBundle } = await loadModule('the code that reads bundles', () => import('../zip/bundle.js'));
    const bundle = openBundle(source);
    return readSogImages(parseSogMeta({ ...source, bytes: bundle.bytes }), bundle.open, source);
  }
  return readSogImages(parseSogMeta(source), open, source);
}

/** Downloads and decodes the images that a preview needs: all images except the coefficients above the constant one. */
async function decodeGeometry(images: Planes, meta: SogMeta, name: string): Promise<GeometryPlanes> {
  const files = [...meta.means.files.slice(0, 2), meta.scales.files[0], meta.quats.files[0], meta.sh0.files[0]];
  const loaded = await Promise.all(files.map((file) => images.load(file)));
  const bytes = loaded.reduce((sum, file) => sum + file.length, 0);
  const max = FREE_SPLATS + MAX_SPLATS_PER_BYTE * bytes;
  if (meta.count > max) {
    throw damaged(
      `${name}, count`,
      `at most ${grouped(max)} splats in ${grouped(bytes)} bytes`,
      grouped(meta.count),
      'decode/header',
    );
  }
  const decoded: Uint32Array[] = [];
  for (const [k, file] of files.entries()) decoded.push(await images.decodePlane(loaded[k], file, meta.count));
  const [low, high, scales, quats, sh0] = decoded;
  return { low, high, scales, quats, sh0 };
}

/**
 * Returns a cloud of every `step`-th splat. Coefficients above the constant one are 0.
 * @param degree Degree of the cloud.
 */
function unpackGeometry(
  planes: GeometryPlanes,
  meta: SogMeta,
  step: number,
  degree: ShDegree,
  source: SceneSource,
): DraftCloud {
  const selection: Selection = { count: Math.ceil(meta.count / step), step };
  const cloud = allocateCloud(selection.count, degree, source);
  cloud.antialiased = meta.antialiased;
  if (meta.isFlat) warn(cloud, FLAT);
  cloud.filterVariance = meta.filterVariance;
  if (meta.order) cloud.hints = { order: meta.order };
  addCredits(cloud, meta.credits);
  unpackMeans(planes.low, planes.high, meta.means, selection, cloud.positions);
  unpackScales(planes.scales, meta.scales, selection, cloud.scales);
  unpackQuats(planes.quats, selection, cloud.rotations);
  unpackColors(planes.sh0, meta.sh0, selection, cloud);
  return cloud;
}

/** Returns the degree of spherical harmonics, from the width of the palette's image. Throws if `meta.json` differs. */
function checkDegree({ shN }: SogMeta, width: number, name: string): ShDegree {
  const found = DEGREE_OF_REST_COUNT.get(width / PALETTE_ROW);
  const expected = shN?.degree ?? found;
  if (found === undefined || found === 4 || found === 0 || found !== expected) {
    const widths = expected ? `${PALETTE_ROW * ((expected + 1) ** 2 - 1)}` : '192, 512 or 960';
    throw damaged(`${name}, ${shN?.files[0]}`, `a palette ${widths} pixels wide`, String(width));
  }
  return found;
}

function paletteOf({ paletteSize, values }: NonNullable<SogMeta['shN']>, image: WebpImage): Palette {
  return { pixels: image.pixels, size: Math.min(paletteSize, PALETTE_ROW * image.height), values };
}
