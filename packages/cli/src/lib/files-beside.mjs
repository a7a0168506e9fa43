import { existsSync, readFileSync, realpathSync } from 'node:fs';
import { basename, dirname, extname, join, posix, sep } from 'node:path';

/** Keys whose values are file names in the JSON of SOG, streamed SOG, LOD pages and sequences. */
const KEYS = new Set(['files', 'filenames', 'environment', 'file', 'frames']);
/** Keys whose values are relative references (RFC 3986) in the JSON of 3D Tiles. */
const URI_KEYS = new Set(['uri', 'url']);

/**
 * Finds the files that a scene or a model refers to: buffers and images of a glTF, weights and contract of a model, and
 * files in JSON, in tilesets and in RAD, and those that these files refer to. A damaged file refers to none; the page
 * reports its fault. Requires built packages.
 * @returns `found`: paths relative to the folder of the scene. `missing`: paths of files that do not exist or are outside
 * the folder, with the reason.
 */
export async function filesBeside(scene) {
  const { isInside } = await import('@gaussian-splat/core/contract');
  const [found, missing] = [new Set(), new Map()];
  const visit = async (path) => {
    const folder = posix.dirname(path);
    for (const name of await namedBy(join(dirname(scene), path)).catch(() => [])) {
      const file = posix.join(folder, name);
      if (!isInside(file)) missing.set(file, 'outside of its folder');
      else if (!existsSync(join(dirname(scene), file))) missing.set(file, 'missing');
      else if (leadsOut(scene, file)) missing.set(file, 'a link out of its folder');
      else if (!found.has(file)) {
        found.add(file);
        await visit(file);
      }
    }
  };
  await visit(basename(scene));
  const contract = sidecarOf(scene, await import('@gaussian-splat/core/contract'));
  if (contract && existsSync(join(dirname(scene), contract)) && !leadsOut(scene, contract)) found.add(contract);
  return { found: [...found], missing: [...missing].map(([file, why]) => `${file} (${why})`) };
}

/** Whether a link leads out of the scene's folder. Untrusted archives may contain links to any file of the machine. */
const leadsOut = (scene, file) => {
  const folder = realpathSync(dirname(scene));
  return !realpathSync(join(folder, file)).startsWith(folder.endsWith(sep) ? folder : folder + sep);
};

/** Returns the name of a model's contract; undefined for other files. A model may have none. */
const sidecarOf = (scene, { sidecarPath }) =>
  extname(scene).toLowerCase() === '.onnx' ? sidecarPath(basename(scene)) : undefined;

async function namedBy(file) {
  const readers = {
    '.gltf': buffersOf,
    '.onnx': weightsOf,
    '.json': partsOf,
    '.lcc': partsOfLcc,
    '.lcc2': partsOfLcc2,
    '.rad': chunksOfRad,
  };
  const read = readers[extname(file).toLowerCase()];
  return read === undefined ? [] : read(file);
}

/** Not every LCC scene has harmonics and surroundings. */
const partsOfLcc = (file) => [
  ...['index.bin', 'data.bin'],
  ...['shcoef.bin', 'environment.bin'].filter((name) => existsSync(join(dirname(file), name))),
];

function partsOfLcc2(file) {
  const { root } = JSON.parse(readFileSync(file, 'utf8'));
  const earlier = root.files?.map((path) => path.replace(/^\//, '').replace(/(\.sog)?$/, '.sog'));
  return root.splatFiles ?? earlier ?? [];
}

/** The header of a RAD file: 4 bytes of signature, the length of its JSON, and the JSON. */
function chunksOfRad(file) {
  const bytes = readFileSync(file);
  const { chunks = [] } = JSON.parse(bytes.subarray(8, 8 + bytes.readUInt32LE(4)).toString('utf8'));
  return chunks.flatMap(({ filename }) => filename ?? []);
}

/** Returns the path of a relative reference, without its query; none for other references. */
const pathOf = (uri) =>
  typeof uri !== 'string' || /^[a-z]+:/i.test(uri) ? [] : [decodeURIComponent(uri.replace(/[?#].*$/, ''))];

async function buffersOf(file) {
  const { buffers = [], images = [] } = JSON.parse(readFileSync(file, 'utf8'));
  return [...buffers, ...images].flatMap(({ uri }) => pathOf(uri));
}

async function weightsOf(file) {
  const { bytesSource, readOnnxHeader } = await import('@gaussian-splat/core/onnx');
  const header = await readOnnxHeader(bytesSource(readFileSync(file), file));
  return header.externalFiles.map(({ location }) => location);
}

async function partsOf(file) {
  const bytes = readFileSync(file);
  const json = JSON.parse(bytes.toString('utf8').replace(/^\ufeff/, ''));
  if (json.gaussianSplatSequence !== undefined) {
    const { parseSequence, sequencePaths } = await import('@gaussian-splat/formats');
    return [...sequencePaths(parseSequence(bytes, file))];
  }
  const names = [];
  const open = [json];
  while (open.length > 0) {
    for (const [key, value] of Object.entries(open.pop())) {
      if (KEYS.has(key))
        for (const name of [value].flat()) if (typeof name === 'string' && name !== '') names.push(name);
      if (URI_KEYS.has(key)) names.push(...pathOf(value));
      if (typeof value === 'object' && value !== null) open.push(value);
    }
  }
  return names;
}
