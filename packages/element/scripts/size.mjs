/**
 * `npm run size -w @gaussian-splat/element`: bytes of the CDN build, and of what a page with a PLY scene fetches of it.
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

/**
 * Paths of what a page fetches to show a PLY scene: element, worker, PLY reader, and what these import. Parts that the element fetches later are not counted: the
 * self-test of the GPU, beside the scene, and printing, after the first frame.
 */
export function scriptsForPly() {
  const reader = readdirSync(join(CDN, 'readers')).find((file) => /^ply-[^.]+\.js$/.test(file));
  if (reader === undefined) throw new Error(`no PLY reader found in ${CDN}readers`);
  const needed = new Set();
  for (const entry of ['gaussian-splat.min.js', 'scene-worker.js', join('readers', reader)])
    addWithImports(entry, needed);
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
  'camera controls': ['input-controller', 'box-points', 'corner-button', 'label-parts'],
};

/** Total gzip bytes of scripts, by the names before their hashes. */
function bytesOf(names) {
  const sizes = scriptSizes();
  return names.reduce((sum, name) => {
    const found = sizes.find(({ file }) => new RegExp(`^${name}-[^.]{8}\\.js$`).test(file));
    if (found === undefined) throw new Error(`no script ${name} found in ${CDN}`);
    return sum + found.gzip;
  }, 0);
}

/** Total gzip bytes of {@link scriptsForPly}. */
export function plyPageSize() {
  const sizes = new Map(scriptSizes().map(({ file, gzip }) => [file, gzip]));
  return scriptsForPly().reduce((sum, file) => sum + sizes.get(file), 0);
}

function print() {
  const forPly = new Set(scriptsForPly());
  console.log('script                                        raw      gzip');
  for (const { file, raw, gzip } of scriptSizes()) {
    const mark = forPly.has(file) ? '*' : ' ';
    console.log(`${mark} ${file.padEnd(40)}${String(raw).padStart(7)}${String(gzip).padStart(10)}`);
  }
  console.log(`* fetched for a PLY scene: ${plyPageSize()} bytes of gzip (at most ${BUDGET})`);
  for (const [purpose, names] of Object.entries(BESIDE)) console.log(`  ${purpose}: ${bytesOf(names)} bytes of gzip`);
  console.log(`integrity of gaussian-splat.min.js: ${integrityOf(join(CDN, 'gaussian-splat.min.js'))}`);
}

if (basename(process.argv[1] ?? '') === 'size.mjs') print();
