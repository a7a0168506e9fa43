import { GaussianSplatError, type GaussianCloud } from '@gaussian-splat/core';
import { asciiOf, grouped, viewOf } from '../bytes.js';
import { findFormat } from '../detect.js';
import { damaged } from '../faults.js';
import { loadDiagnosis, loadReader } from '../load-files.js';
import { MAX_INDEX_BYTES } from '../lod/meta.js';
import type { SceneSource } from '../scene-format.js';
import { MAX_META_BYTES } from '../sog/meta.js';
import { Archive } from '../zip/archive.js';
import { listed, namedLike, relevant, shallowest } from '../zip/paths.js';

/**
 * Main files of scenes with several files, with their maximum sizes in bytes. Files that refer to others come first,
 * because the first one that is found is used.
 */
const DESCRIPTIONS = [
  ['lod-meta.json', MAX_INDEX_BYTES],
  ['meta.json', MAX_META_BYTES],
  ['tileset.json', MAX_INDEX_BYTES],
] as const;
/** Maximum number of files with the same name of {@link DESCRIPTIONS} that are opened to find a scene. */
const MAX_DESCRIPTIONS = 16;
const SCENE_FILE = /\.(gltf|glb|ply|spz|splat|ksplat|sog|rad|lcc2?|usd[ac]?)$/i;
/** Matches the layers of OpenUSD. The first file of a USDZ is its root layer. */
const LAYER = /\.usd[ac]?$/i;
/** Matches PLY files that are not the result of training: initial points in 3DGS, COLMAP and nerfstudio, and cameras. */
const FIRST_POINTS = /(^|\/)(input|sparse(_pc)?|points?(3d)?|cameras?)\.ply$/i;
/** Matches the splats after a number of iterations in the output of 3DGS. Group 1 is the folder, group 2 the number. */
const ITERATION = /^(.*\/)?iteration_(\d+)\/point_cloud\.ply$/i;

/**
 * Reads a ZIP file that contains one scene: a SOG bundle (`.sog`), a streamed SOG scene, a glTF with its buffers, or one
 * file of any other format. The scene in the least nested folder is read, and the one after the most iterations of
 * training. A scene may be an archive, too, such as a bundle, but not an archive in an archive.
 */
export async function readZip(source: SceneSource): Promise<GaussianCloud> {
  const { name } = source;
  const archive = new Archive(source);
  const path = await mainFile(archive, name);
  if (path === undefined) throw await noSceneIn(archive, name);
  const folder = path.slice(0, path.lastIndexOf('/') + 1);
  const inner = archive.open(path);
  const format = findFormat(inner, path, '');
  if (!format) throw noScene(name, path, 'a file that is not a scene');
  if (format.name === 'zip' && source.openFile === WITHIN)
    throw noScene(name, path, 'an archive within an archive within an archive');
  const read = await loadReader(format);
  const openFile =
    format.name === 'zip' ? WITHIN : async (part: string): Promise<Uint8Array> => archive.open(folder + part);
  return read({ ...source, bytes: inner, name: `${name}, ${path}`, openFile });
}

/** Value of `openFile` that marks a nested archive for {@link readZip}. */
const WITHIN = async (): Promise<Uint8Array> => new Uint8Array(0);

/** Returns the path of the scene in an archive; undefined if there is none. Throws if several scenes are equally likely. */
async function mainFile(archive: Archive, name: string): Promise<string | undefined> {
  const paths = relevant(archive.paths);
  if (LAYER.test(paths[0] ?? '')) return paths[0];
  for (const [description, max] of DESCRIPTIONS) {
    // Files named meta.json may be of another program.
    const named = namedLike(description, paths)
      .filter((path) => archive.lengthOf(path) <= max)
      .slice(0, MAX_DESCRIPTIONS);
    const found = shallowest(named.filter((path) => findFormat(archive.open(path), '', '') !== undefined));
    if (found.length > 1) throw severalScenes(name, found);
    if (found.length === 1) return found[0];
  }
  const files = paths.filter((path) => SCENE_FILE.test(path));
  const trained = files.filter((path) => !FIRST_POINTS.test(path));
  const scenes = withoutMeshes(shallowest(trained.length > 0 ? trained : files), archive);
  if (scenes.length === 1) return scenes[0];
  const last = lastIteration(scenes);
  if (last !== undefined) return last;
  // The other scenes may be files that a description refers to.
  const descriptions = scenes.filter((path) => /\.(gltf|lcc2?)$/i.test(path));
  if (descriptions.length === 1) return descriptions[0];
  if (scenes.length > 0) throw (await namedArchive(archive, name)) ?? severalScenes(name, scenes);
  return undefined;
}

/** Returns the paths without GLB files that contain no splats; all paths if no other is left. */
function withoutMeshes(scenes: readonly string[], archive: Archive): readonly string[] {
  if (scenes.length < 2) return scenes;
  const hasSplats = (path: string): boolean => {
    const bytes = archive.open(path);
    return asciiOf(bytes, 20, 20 + viewOf(bytes).getUint32(12, true)).includes('KHR_gaussian_splatting');
  };
  const left = scenes.filter((path) => !/\.glb$/i.test(path) || archive.lengthOf(path) < 20 || hasSplats(path));
  return left.length > 0 ? left : scenes;
}

/** Returns the error for an archive of a known but unsupported kind; undefined for others. */
async function namedArchive({ paths }: Archive, name: string): Promise<GaussianSplatError | undefined> {
  const { diagnoseArchive } = await loadDiagnosis();
  return diagnoseArchive(paths, name);
}

async function noSceneIn(archive: Archive, name: string): Promise<GaussianSplatError> {
  const known = await namedArchive(archive, name);
  if (known) return known;
  const paths = relevant(archive.paths);
  for (const [description, max] of DESCRIPTIONS)
    for (const path of namedLike(description, paths)) {
      const length = archive.lengthOf(path);
      if (length > max)
        return damaged(`${name}, ${path}`, `a description of at most ${grouped(max)} bytes`, grouped(length));
    }
  return noScene(name, undefined, `a ZIP archive with ${listed(paths)}`);
}

/** Returns the path with the most iterations if all paths are the same scene during training; otherwise undefined. */
function lastIteration(paths: readonly string[]): string | undefined {
  const found = paths.map((path) => ITERATION.exec(path));
  const [first] = found;
  if (!first || found.some((match) => match === null || match[1] !== first[1])) return undefined;
  const iterations = found.map((match) => Number(match![2]));
  return paths[iterations.indexOf(Math.max(...iterations))];
}

function noScene(name: string, path: string | undefined, found: string): GaussianSplatError {
  return new GaussianSplatError('decode/unknown-format', {
    where: path === undefined ? name : `${name}, ${path}`,
    expected: 'a ZIP archive with a Gaussian splat scene in it',
    found,
    remedy: 'give the address of a scene file, or of an archive of one: .ply, .spz, .splat, .ksplat, .sog, .glb, .usdz',
  });
}

function severalScenes(name: string, scenes: readonly string[]): GaussianSplatError {
  return new GaussianSplatError('decode/unsupported', {
    where: name,
    expected: 'one scene in the archive',
    found: `${scenes.length} scenes: ${listed(scenes)}`,
    remedy: 'pack each scene separately; for scenes that follow one another in time, serve the files and a manifest',
  });
}
