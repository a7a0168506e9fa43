/**
 * Scripts of one file, in a fifth of Rollup's time. Rolldown keeps all exports of a package that is imported late, and has no least size of chunks: the rest is Rollup's.
 * `PART=three` comes before Rollup's build, which needs its file, and `single` after it.
 */
import { cpSync, mkdirSync, rmSync, writeFileSync } from 'node:fs';
import { dirname } from 'node:path';
import { fileURLToPath } from 'node:url';
import { keepImports, sources, THREE_OF_PACKAGE } from './rollup.config.mjs';

const path = (name) => fileURLToPath(new URL(name, import.meta.url));

/** They leave out the decoders of Draco and KTX2, which few pages need: the page has them in chunks. */
const withoutDecoders = {
  name: 'without-decoders',
  load: (id) =>
    /\/(triangles|readers)\/(draco|basis)-code[^/]*\.js$/.test(id)
      ? `export const create = undefined, wasm = '';`
      : null,
};

/** Chunks import what they share from the worker's script: the one file exports only what pages call. */
const WORKER = 'worker';
const exportsOfPages = {
  name: 'exports-of-pages',
  resolveId: (id) => (id === WORKER ? id : null),
  load: (id) => (id === WORKER ? `export { runOnPage } from ${JSON.stringify(path('./cdn/scene-worker.js'))};` : null),
};

/** Chunks are called by what is in them, and most carry a hash: those of earlier builds would pile up. */
const MADE = ['./cdn', './dist/production', './dist/loading/worker-code'];

/** The minifier drops the comments that bundlers of apps need. */
const forBundlers = {
  name: 'for-bundlers',
  generateBundle: (_, bundle) => Object.values(bundle).forEach((chunk) => (chunk.code = keepImports(chunk.code))),
};

/** three.js, as much of it as meshes need. The package's own module is the file of the CDN build, whose types stay with the sources. */
const threeOfPackage = {
  name: 'three-of-package',
  buildStart: () => MADE.forEach((folder) => rmSync(path(folder), { recursive: true, force: true })),
  writeBundle(_, bundle) {
    const { fileName } = Object.values(bundle).find(({ isEntry }) => isEntry);
    mkdirSync(dirname(THREE_OF_PACKAGE), { recursive: true });
    writeFileSync(THREE_OF_PACKAGE, `export * from '../../../cdn/${fileName}';\n`);
    cpSync(path('./src/sources/mesh/three.d.ts'), path('./dist/sources/mesh/three.d.ts'));
  },
};

const resolve = { conditionNames: ['production', 'browser', 'import', 'default'] };
const single = { format: 'es', codeSplitting: false, minify: true };

const PARTS = {
  three: [
    {
      // A package of 24 MB otherwise.
      input: { three: path('./scripts/three.mjs') },
      ...{ resolve, plugins: [threeOfPackage] },
      output: { dir: path('./cdn'), entryFileNames: '[name]-[hash].js', ...single, comments: { legal: true } },
    },
  ],
  single: [
    {
      // For bundlers (src/loading/worker-sources.ts), made of the CDN build.
      input: WORKER,
      plugins: [exportsOfPages, withoutDecoders, forBundlers],
      output: { file: path('./dist/loading/scene-worker.bundle.js'), ...single },
    },
    {
      // For `gaussian-splat page --single`.
      input: path('./dist/index.js'),
      ...{ resolve, plugins: [withoutDecoders, ...sources.filter(({ name }) => name !== 'node-resolve')] },
      output: { file: path('../cli/dist/single.js'), ...single },
    },
  ],
};

export default PARTS[process.env.PART];
