/** Files of scenes for measurements of bytes: how they are made, and read. */
import { spawn } from 'node:child_process';
import { existsSync, readFileSync, statSync } from 'node:fs';
import { basename, join } from 'node:path';
import { readScene } from '@gaussian-splat/formats';
import { cloudOfChunks, decodePage } from '@gaussian-splat/renderer/tools';
import { root } from '../lib/run.mjs';

/** The tool of others that writes their formats, by npx. */
export const TRANSFORM = '@playcanvas/splat-transform@3.7.0';

/** Whether a file exists, or a folder of pages with its manifest, which is written last. */
const isMade = (path) => existsSync(path) && (!statSync(path).isDirectory() || existsSync(join(path, 'detail.json')));

/**
 * Runs a command that makes a file or a folder of pages, unless it exists. Resolves to false if the command fails.
 * @param isKept whether only existing files are used
 */
export async function make(path, command, args, isKept = false) {
  if (isMade(path) || isKept) return isMade(path);
  console.log(`  ${basename(path)} ...`);
  const child = spawn(command, args, { cwd: root, stdio: ['ignore', 'ignore', 'pipe'] });
  let errors = '';
  child.stderr.setEncoding('utf8').on('data', (text) => (errors += text));
  const status = await new Promise((done) => child.on('error', done).on('close', done));
  if (status === 0) return true;
  const reason = status instanceof Error ? status.message : errors.trim().split('\n').at(-1);
  console.log(`  ${basename(path)} not made: ${reason}`);
  return false;
}

export const own = (...args) => [join(root, 'packages/cli/bin/gaussian-splat.mjs'), ...args];

/** Signs of coefficients in a half turn about x. */
const HALF_TURN = [1, -1, -1, 1, -1, 1, 1, -1, 1, -1, 1, -1, -1, 1, -1, 1];

/** The cloud turned by half a turn about x: splat-transform 3.7.0 writes SPZ in the frame of PLY (docs/decisions/0022). */
export function halfTurned(cloud) {
  const numbers = 3 * (cloud.shDegree + 1) ** 2;
  return {
    ...cloud,
    positions: cloud.positions.map((value, k) => (k % 3 === 0 ? value : -value)),
    rotations: cloud.rotations.map((_, k, all) => {
      const [w, x, y, z] = all.subarray(k - (k % 4), k - (k % 4) + 4);
      return [-x, w, -z, y][k % 4];
    }),
    sh: cloud.sh.map((value, k) => HALF_TURN[Math.floor((k % numbers) / 3)] * value),
  };
}

export async function read(path) {
  const openFile = async (part) => new Uint8Array(readFileSync(join(path, '..', part)));
  return readScene(new Uint8Array(readFileSync(path)), { name: basename(path), openFile });
}

/** The shortest of three times in ms, and the result. */
export async function timed(work) {
  let [min, found] = [Infinity, undefined];
  for (let k = 0; k < 3; k++) {
    const start = performance.now();
    found = await work();
    min = Math.min(min, performance.now() - start);
  }
  return [min, found];
}

/** Pages of a folder, decoded: the finest of them as a cloud, and how many bytes there are of all and of the first. */
export async function readFolder(folder) {
  const manifest = JSON.parse(readFileSync(join(folder, 'detail.json'), 'utf8'));
  const { coding, shDegree, trees } = manifest;
  const [{ pages }] = trees;
  const isParent = new Set(pages.flatMap(({ parent }) => (parent ? [`${parent}`] : [])));
  const parts = [];
  for (const [p, { file, chunks, upper }] of pages.entries()) {
    const bytes = new Uint8Array(readFileSync(join(folder, file)));
    const words = new Uint32Array(await decodePage(file, bytes, { chunks, upper, shDegree, coding }));
    // The finest: nothing is below them, in this file or in another.
    const leaves = Array.from({ length: chunks }, (_, c) => c).filter(
      (c) => !isParent.has(`${[p, c]}`) && 4 * c >= chunks - upper,
    );
    parts.push({ words, of: chunks, chunks: leaves });
  }
  const sizes = pages.map(({ file }) => statSync(join(folder, file)).size);
  const index = statSync(join(folder, 'detail.json')).size;
  return {
    cloud: cloudOfChunks(manifest, parts),
    bytes: index + sizes.reduce((sum, size) => sum + size, 0),
    first: index + sizes[0],
  };
}
