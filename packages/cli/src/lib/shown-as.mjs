/** Reads a file before it is published: is it a scene, a mesh, or nothing that a page can show? Requires built packages. */
import { readFileSync, statSync } from 'node:fs';
import { open } from 'node:fs/promises';
import { basename, extname } from 'node:path';
import { LoadBudget, parseSequence, readScene, readTriangles } from '@gaussian-splat/formats';
import { CommandError, report } from './command.mjs';
import { filesBeside } from './files-beside.mjs';
import { readerBeside } from './input-file.mjs';

/** Larger scenes are checked by their beginning, in bytes. */
const MAX_WHOLE = 1 << 29;
const BEGINNING = 1 << 24;

/** Files that begin like this are read by the page alone. */
const CLIPS = { '.gsv': 'GSV\n', '.4dgs': '\x894DGS' };

/** Attributes for a file that plays: the element has a button that pauses only with them. */
const PLAYS = ['autoplay', 'loop'];
/** Roles of inputs that visitors set in the panel. */
const PANEL = new Set(['control', 'pose', 'shape', 'image']);

/**
 * Returns what shows a file. `tag`: `gaussian-splat` for scenes, clips, sequences, streamed folders and generators, or
 * `splat-mesh` for files with triangles alone. `attributes`: names of attributes without values.
 * @param path {string}
 * @throws GaussianSplatError or CommandError for files that no tag shows, with the reason and a remedy.
 */
export async function shownAs(path) {
  const { size } = statSync(path);
  const tag = 'gaussian-splat';
  if (size > 0 && extname(path).toLowerCase() === '.onnx') return { tag, attributes: await attributesOfModel(path) };
  const manifest = size > 0 ? await manifestOf(path) : undefined;
  if (manifest) return { tag, attributes: manifest.plays ? PLAYS : [] };
  return readAs(path, size);
}

async function readAs(path, size) {
  const isWhole = size <= MAX_WHOLE;
  const bytes = isWhole ? readFileSync(path) : await beginningOf(path);
  const start = CLIPS[extname(path).toLowerCase()];
  const scene = { tag: 'gaussian-splat', attributes: [] };
  if (start && bytes.toString('latin1', 0, start.length) === start) return { ...scene, attributes: PLAYS };
  const name = basename(path);
  const openFile = readerBeside(path);
  try {
    const { count } = await readScene(bytes, { name, openFile });
    report({ splats: count });
  } catch (error) {
    if (error.code === 'decode/truncated' && !isWhole) return scene;
    if (error.code !== 'decode/not-splats') throw error;
    const openUri = (uri) => openFile(decodeURIComponent(uri.replace(/[?#].*$/, '')));
    const budget = new LoadBudget(size, {});
    // A cloud of points, which has no faces, is not a mesh either.
    await readTriangles({ bytes, name, budget, openUri }).catch(() => Promise.reject(error));
    return { ...scene, tag: 'splat-mesh' };
  }
  return scene;
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

async function attributesOfModel(path) {
  const { checkModel } = await import('@gaussian-splat/check');
  const { faults, contract } = await checkModel(path);
  if (faults[0] instanceof Error) throw faults[0];
  const { ContractError } = await import('@gaussian-splat/core/contract');
  if (faults.length > 0) throw new ContractError(faults);
  if (contract.outputs.layout === 'image')
    throw new CommandError(
      `${path} is a post-processor, which makes an image of a frame. Make a page of a scene, and write postprocess="${basename(path)}" into its tag.`,
    );
  const roles = Object.values(contract.inputs).map(({ role }) => role);
  const plays = roles.some((role) => role === 'time' || role === 'frame');
  return [...(plays ? PLAYS : []), ...(roles.some((role) => PANEL.has(role)) ? ['controls-panel'] : [])];
}

/**
 * Returns whether a JSON file plays: `plays` is true for a sequence, false for a streamed scene; undefined for other
 * files. The files that they name are read by the page alone.
 */
async function manifestOf(path) {
  if (extname(path).toLowerCase() !== '.json') return undefined;
  const bytes = readFileSync(path);
  let json;
  try {
    json = JSON.parse(bytes.toString('utf8').replace(/^\ufeff/, ''));
  } catch {
    return undefined;
  }
  if (json?.gaussianSplatSequence !== undefined) {
    parseSequence(bytes, path);
    return { plays: true };
  }
  const { found, missing } = await filesBeside(path);
  if (found.length > 0) return { plays: false };
  if (missing.length === 0) return undefined;
  throw new CommandError(`${path} names files that are not beside it: ${missing.join(', ')}. Copy them there.`);
}
