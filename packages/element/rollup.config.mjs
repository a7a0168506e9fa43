/**
 * The CDN build: `cdn/gaussian-splat.min.js` (the element and the renderer in one file, for a script tag with an
 * integrity attribute), and beside it the scene worker with a chunk for every reader, which it finds from its own URL.
 */
import { cpSync, mkdirSync, rmSync } from 'node:fs';
import { createRequire } from 'node:module';
import { dirname, join } from 'node:path';
import { fileURLToPath } from 'node:url';
import { nodeResolve } from '@rollup/plugin-node-resolve';
import terser from '@rollup/plugin-terser';
import { minifyTemplateLiterals } from 'rollup-plugin-minify-template-literals';
import { shortShaders } from './scripts/shader-plugin.mjs';
import { transform } from 'esbuild';

const path = (name) => fileURLToPath(new URL(name, import.meta.url));

/** esbuild gives the private names of all classes the same few letters. Terser, which is better at all else, gives each its own. */
const shortPrivates = {
  name: 'short-privates',
  renderChunk: (code) =>
    transform(code, { format: 'esm', target: 'es2022', minifyIdentifiers: true, sourcemap: 'external' }),
};

const plugins = [
  nodeResolve({ exportConditions: ['production', 'browser'] }),
  shortShaders(),
  shortPrivates,
  minifyTemplateLiterals({
    include: [path('./dist/styles.js'), path('./dist/template.js'), path('./dist/views/tour.js')],
  }),
  // Statements compress better than what they can be joined to with commas. No property is read here for what its getter does.
  terser({
    module: true,
    ecma: 2022,
    compress: { passes: 4, sequences: false, inline: 1, keep_fargs: false, pure_getters: true },
    format: { comments: false },
  }),
];

/** three.js has sources of its own: a map of them would weigh more than all else in the package. */
const noMapOfThree = {
  name: 'no-map-of-three',
  generateBundle(_options, bundle) {
    for (const chunk of Object.values(bundle)) {
      if (!chunk.moduleIds?.some((id) => id.includes('/node_modules/three/build/'))) continue;
      delete bundle[`${chunk.fileName}.map`];
      chunk.code = chunk.code.replace(/\n\/\/# sourceMappingURL=\S+\s*$/, '\n');
      chunk.map = null;
    }
  },
};

/** Chunks carry a hash in their name, so those of earlier builds would pile up. */
const emptyFirst = { name: 'empty-first', buildStart: () => rmSync(path('./cdn'), { recursive: true, force: true }) };

/** ONNX Runtime for generators, in both its builds: fetched by pages that show a generator, and by no other. */
const RUNTIME_FILES = [
  'ort.jspi.bundle.min.mjs',
  'ort-wasm-simd-threaded.jspi.wasm',
  'ort.webgpu.bundle.min.mjs',
  'ort-wasm-simd-threaded.asyncify.wasm',
];

const copyRuntime = {
  name: 'copy-runtime',
  writeBundle() {
    const from = dirname(createRequire(import.meta.url).resolve('onnxruntime-web/webgpu'));
    mkdirSync(path('./cdn/onnxruntime'), { recursive: true });
    for (const file of RUNTIME_FILES) cpSync(join(from, file), path(`./cdn/onnxruntime/${file}`));
  },
};

const output = {
  dir: path('./cdn'),
  format: 'es',
  sourcemap: true,
  chunkFileNames: 'readers/[name]-[hash].js',
};

export default [
  {
    input: { 'gaussian-splat.min': path('./dist/index.js') },
    // Where workers are refused, the element imports the worker's module; it is the same file, not a copy.
    external: (id) => id.endsWith('scene-worker.js'),
    // What generators need is a chunk of its own, loaded when the first is shown; it finds the runtime beside itself.
    preserveEntrySignatures: 'allow-extension',
    plugins: [emptyFirst, ...plugins, noMapOfThree, copyRuntime],
    // What two chunks share and is smaller than a request for it goes where the page has it already.
    output: {
      ...output,
      chunkFileNames: 'generator-[hash].js',
      paths: () => './scene-worker.js',
      experimentalMinChunkSize: 500,
    },
  },
  {
    input: { 'scene-worker': path('./dist/loading/scene-worker.js') },
    // The page imports `loadScene` from it, so its exports stay; readers import what they share with it from it.
    preserveEntrySignatures: 'allow-extension',
    plugins,
    output,
  },
];
