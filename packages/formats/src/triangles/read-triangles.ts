import { GaussianSplatError } from '@gaussian-splat/core';
import type { Credits } from '@gaussian-splat/core';
import type { LoadBudget } from '../budget.js';
import { creditsOfAsset } from '../credits.js';
import { asciiOf } from '../bytes.js';
import { loadDetection, loadDiagnosis } from '../load-files.js';
import { isPly } from '../signatures.js';
import { readPlyMesh } from './ply-mesh.js';
import { leftOutExtensions, openContainer, type Json } from '../gltf/container.js';
import { GltfDocument, type OpenUri } from '../gltf/document.js';
import { decodeDraco } from './draco.js';
import { Images, type ImageFile } from './images.js';
import { Survey } from './survey.js';
import { trimmed } from './trim.js';
import { Views } from './views.js';

/** Input of {@link readTriangles}: a file in memory, and access to the files that it refers to. */
export interface TriangleSource {
  readonly bytes: Uint8Array;
  /** Name of the file in error messages. */
  readonly name: string;
  readonly budget: LoadBudget;
  /**
   * Fetches a file that the glTF refers to.
   * @param uri URI as in the glTF, relative or absolute, but not `data:`.
   */
  readonly openUri: OpenUri;
}

/** Triangles, points and lines of a file: a glTF whose JSON refers to no other file, and its binary content. */
export interface TriangleFile {
  /**
   * JSON of glTF 2.0 with one scene, without splats, cameras and extras. Buffer views have neither buffers nor offsets,
   * because their bytes are in `views`. Images have neither URIs nor buffer views, because they are in `images`.
   */
  readonly json: Json;
  /** Content of each buffer view, decompressed, in a buffer of its own; undefined if unused. */
  readonly views: readonly (Uint8Array<ArrayBuffer> | undefined)[];
  /** Encoded file of each image; undefined for unused ones. */
  readonly images: readonly (ImageFile | undefined)[];
  /** GPU memory of geometry and textures in bytes. */
  readonly byteLength: number;
  /** Number of triangles that a frame draws, including instances. */
  readonly triangles: number;
  /** Messages about parts of the file that are not shown. */
  readonly warnings: readonly string[];
  /** Credits that the glTF declares. */
  readonly credits?: Credits | undefined;
}

/** Matches the extensions that a file may require. */
const KNOWN =
  /^(KHR_mesh_quantization|(EXT|KHR)_meshopt_compression|KHR_draco_mesh_compression|EXT_mesh_gpu_instancing|KHR_lights_punctual|KHR_texture_(transform|basisu)|EXT_texture_webp|KHR_materials_\w+|EXT_materials_\w+|KHR_gaussian_splatting\w*|\w+_(xmp|structural_metadata|mesh_features)\w*)$/;
/**
 * Reads the triangles of a glTF 2.0, GLB or PLY file. Before content is decoded, all numbers that determine the size of
 * an allocation are validated, and all content is charged to the budget.
 *
 * @throws GaussianSplatError `decode/*`, `out-of-memory/budget`, and the errors of `openUri`.
 */
export async function readTriangles(source: TriangleSource): Promise<TriangleFile> {
  const { bytes, name, budget, openUri } = source;
  if (isPly(bytes)) return readPlyMesh(source);
  if (!/^(glTF|(\u00ef\u00bb\u00bf)?\s*\{)/.test(asciiOf(bytes, 0, 64))) throw await notMesh(bytes, name);
  const file = openContainer({ bytes, name, budget }, KNOWN);
  const document = new GltfDocument(file, { name, budget }, { uri: openUri });
  const survey = new Survey(document);
  if (survey.draws === 0) throw noTriangles(name);
  await decodeDraco(document, survey);
  const images = new Images(document, survey);
  const views = new Views(document, survey);
  const files = await images.read();
  return {
    json: trimmed(document, survey),
    views: await views.read(),
    images: files,
    byteLength: views.byteLength + survey.copies + images.byteLength,
    triangles: survey.triangles,
    credits: creditsOfAsset(file.json.asset),
    warnings: [...darkLights(survey.darkLights), ...leftOutExtensions(file.json, KNOWN)],
  };
}

/** Returns the error for a file of another kind, such as a scene of splats. */
async function notMesh(bytes: Uint8Array, name: string): Promise<GaussianSplatError> {
  const [{ extensionOf, findFormat }, { diagnoseMesh }] = await Promise.all([loadDetection(), loadDiagnosis()]);
  return diagnoseMesh(bytes, name, extensionOf(name), findFormat(bytes, name, '')?.title);
}

function darkLights(count: number): string[] {
  return count > 0 ? [`${count} lights of a mesh are left out: 16 are shown at most.`] : [];
}

const noTriangles = (name: string): GaussianSplatError =>
  new GaussianSplatError('decode/empty', {
    where: name,
    expected: 'a scene with meshes',
    found: 'none in the default scene of the file',
    remedy:
      'name the scene that shows meshes in "scene", or export the file again; splats are shown by src of <gaussian-splat>',
  });
