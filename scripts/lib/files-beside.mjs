import { existsSync, readFileSync } from 'node:fs';
import { basename, dirname, extname, join } from 'node:path';

/**
 * Files that a scene or a model needs beside it, as paths from its folder: buffers of a glTF, weights and contract of a model. Those that are not there, lie outside of
 * the folder or are named by a damaged file are left out: the page says what is wrong. Needs built packages.
 */
export async function filesBeside(scene) {
  const named = { '.gltf': buffersOf, '.onnx': partsOfModel }[extname(scene).toLowerCase()];
  const paths = named === undefined ? [] : await named(scene).catch(() => []);
  const { isInside } = await import('@gaussian-splat/core');
  return paths.filter((path) => isInside(path) && existsSync(join(dirname(scene), path)));
}

async function buffersOf(scene) {
  const { buffers = [] } = JSON.parse(readFileSync(scene, 'utf8'));
  return buffers.flatMap(({ uri }) => (uri === undefined || /^[a-z]+:/i.test(uri) ? [] : [decodeURIComponent(uri)]));
}

async function partsOfModel(scene) {
  const { bytesSource, readOnnxHeader, sidecarName } = await import('@gaussian-splat/core');
  const beside = [sidecarName(basename(scene))];
  const header = await readOnnxHeader(bytesSource(readFileSync(scene), scene)).catch(() => undefined);
  return [...beside, ...(header?.externalFiles ?? []).map(({ location }) => location)];
}
