/** Reads a file before it is published: is it a scene, a mesh, or nothing that a page can show? Requires built packages. */
import { readFileSync, statSync } from 'node:fs';
import { open } from 'node:fs/promises';
import { basename, dirname, extname, join } from 'node:path';
import { LoadBudget, parseSequence, readScene, readTriangles } from '@gaussian-splat/formats';
import { CommandError, report } from './command.mjs';
import { filesBeside } from './files-beside.mjs';

/** Larger scenes are checked by their beginning, in bytes. */
const MAX_WHOLE = 1 << 29;
const BEGINNING = 1 << 24;

/** Files that begin like this are read by the page alone. */
const CLIPS = { '.gsv': 'GSV\n', '.4dgs': '\x894DGS' };

/**
 * Returns the tag that shows a file: `gaussian-splat` for scenes, clips, sequences, streamed folders and generators, or
 * `splat-mesh` for files with triangles alone.
 * @param path {string}
 * @throws GaussianSplatError or CommandError for files that no tag shows, with the reason and a remedy.
 */
export async function tagShowing(path) {
  const { size } = statSync(path);
  if (size > 0 && extname(path).toLowerCase() === '.onnx') await checkModel(path);
  else if (size > 0 && (await isManifest(path))) return 'gaussian-splat';
  else return readAs(path, size);
  return 'gaussian-splat';
}

async function readAs(path, size) {
  const isWhole = size <= MAX_WHOLE;
  const bytes = isWhole ? readFileSync(path) : await beginningOf(path);
  const start = CLIPS[extname(path).toLowerCase()];
  if (start && bytes.toString('latin1', 0, start.length) === start) return 'gaussian-splat';
  const name = basename(path);
  const beside = (file) => join(dirname(path), file);
  try {
    const { count } = await readScene(bytes, { name, openFile: (file) => readFileSync(beside(file)) });
    report({ splats: count });
  } catch (error) {
    if (error.code === 'decode/truncated' && !isWhole) return 'gaussian-splat';
    if (error.code !== 'decode/not-splats') throw error;
    const openUri = (uri) => readFileSync(beside(decodeURIComponent(uri.replace(/[?#].*$/, ''))));
    const budget = new LoadBudget(size, {});
    // A cloud of points, which has no faces, is not a mesh either.
    await readTriangles({ bytes, name, budget, openUri }).catch(() => Promise.reject(error));
    return 'splat-mesh';
  }
  return 'gaussian-splat';
}

async function beginningOf(path) {
  const file = await open(path);
  try {
    const { buffer, bytesRead } = await file.read(Buffer.alloc(BEGINNING), 0, BEGINNING, 0);
    return buffer.subarray(0, bytesRead);
  } finally {
    await file.close();
  }
}

async function checkModel(path) {
  const { bytesSource, readOnnxHeader } = await import('@gaussian-splat/core/onnx');
  await readOnnxHeader(bytesSource(readFileSync(path), path));
}

/** Whether a JSON file names the files of a sequence, or of a streamed scene. They are read by the page alone. */
async function isManifest(path) {
  if (extname(path).toLowerCase() !== '.json') return false;
  const bytes = readFileSync(path);
  let json;
  try {
    json = JSON.parse(bytes.toString('utf8').replace(/^\ufeff/, ''));
  } catch {
    return false;
  }
  if (json?.gaussianSplatSequence !== undefined) return Boolean(parseSequence(bytes, path));
  const { found, missing } = await filesBeside(path);
  if (found.length > 0) return true;
  if (missing.length === 0) return false;
  throw new CommandError(`${path} names files that are not beside it: ${missing.join(', ')}. Copy them there.`);
}
