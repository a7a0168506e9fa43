/**
 * `npm run size -w @gaussian-splat/element`: bytes of the CDN build, and of what pages with a PLY and an SPZ scene fetch of it.
 */
import { readdirSync, readFileSync } from 'node:fs';
import { basename, dirname, join, relative } from 'node:path';
import { fileURLToPath } from 'node:url';
import { gzipSync } from 'node:zlib';
import { integrityOf } from './integrity.mjs';

const CDN = fileURLToPath(new URL('../cdn/', import.meta.url));
/** Most that the element may weigh: bytes of gzip, readers of the other formats not counted. */
export const BUDGET = 92_000;

/** Every script of the build: `{ file, raw, gzip }` with the path relative to cdn/ and bytes. */
export function scriptSizes() {
  const files = readdirSync(CDN, { recursive: true }).filter((file) => file.endsWith('.js'));
  return files.map((file) => {
    const content = readFileSync(join(CDN, file));
    return { file, raw: content.length, gzip: gzipSync(content, { level: 9 }).length };
  });
}

/** Maximum bytes of gzip until the first image of a page with an SPZ scene and camera controls. */
export const SPZ_BUDGET = 123_400;

/**
 * Paths of what a page fetches to show a PLY scene: element, worker, PLY reader, and what these import. Parts that the element fetches later are not counted: the
 * self-test of the GPU, beside the scene, and printing, after the first frame.
 */
export const scriptsForPly = () => withImports(['gaussian-splat.min.js', 'scene-worker.js', scriptOf('readers/ply')]);

/** Scripts that a page with a large SPZ scene and camera controls also fetches until its first image; `npm run test:apps -- cdn` measures it. */
const FOR_SPZ = [
  ...['readers/spz', 'readers/packing', 'readers/row-packer', 'readers/previews', 'part-uploads'],
  ...['timing', 'search', 'input-controller', 'print-controller'],
];
export const scriptsForSpz = () => withImports(['gaussian-splat.min.js', 'scene-worker.js', ...FOR_SPZ.map(scriptOf)]);

/** Path of a script by its name before the hash. */
function scriptOf(name) {
  const found = scriptSizes().find(({ file }) => file.startsWith(`${name}-`) && file.length === name.length + 12);
  if (found === undefined) throw new Error(`no script ${name} found in ${CDN}`);
  return found.file;
}

function withImports(entries) {
  const needed = new Set();
  for (const entry of entries) addWithImports(entry, needed);
  return [...needed];
}

/** Adds a script and what it imports at once; `import()` is for later. */
function addWithImports(file, needed) {
  if (needed.has(file)) return;
  needed.add(file);
  const code = readFileSync(join(CDN, file), 'utf8');
  for (const [, specifier] of code.matchAll(/(?:^|[;}])(?:import|export)[^"'();]*["'](\.{1,2}\/[^"']+)["']/g)) {
    addWithImports(relative(CDN, join(CDN, dirname(file), specifier)), needed);
  }
}

/** Scripts that a page fetches beside those of {@link scriptsForPly}, by purpose: docs/guide/performance.md has the sums. */
const BESIDE = {
  'the self-test of the GPU': ['search', 'timing', 'sh'],
  'packing of scenes': ['readers/packing', 'readers/sh', 'readers/words', 'readers/chunks'],
  'packing of 16,384 splats and more': ['readers/row-packer'],
  'camera controls': ['input-controller', 'box-points', 'corner-button', 'label-parts'],
};

/** Total gzip bytes of scripts, by their paths. */
export function bytesOf(scripts) {
  const sizes = new Map(scriptSizes().map(({ file, gzip }) => [file, gzip]));
  return scripts.reduce((sum, file) => sum + sizes.get(file), 0);
}

function print() {
  const forPly = new Set(scriptsForPly());
  console.log('script                                        raw      gzip');
  for (const { file, raw, gzip } of scriptSizes()) {
    const mark = forPly.has(file) ? '*' : ' ';
    console.log(`${mark} ${file.padEnd(40)}${String(raw).padStart(7)}${String(gzip).padStart(10)}`);
  }
  console.log(`* fetched for a PLY scene: ${bytesOf([...forPly])} bytes of gzip (at most ${BUDGET})`);
  console.log(
    `  an SPZ scene, until its first image: ${bytesOf(scriptsForSpz())} bytes of gzip (at most ${SPZ_BUDGET})`,
  );
  for (const [purpose, names] of Object.entries(BESIDE))
    console.log(`  ${purpose}: ${bytesOf(names.map(scriptOf))} bytes of gzip`);
  console.log(`integrity of gaussian-splat.min.js: ${integrityOf(join(CDN, 'gaussian-splat.min.js'))}`);
}

if (basename(process.argv[1] ?? '') === 'size.mjs') print();
