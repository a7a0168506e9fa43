/**
 * The CDN build: `cdn/gaussian-splat.min.js` (the element and the renderer in one file, for a script tag with an
 * integrity attribute), and beside it the scene worker with a chunk for every reader, which it finds from its own URL.
 */
import { rmSync } from 'node:fs';
import { fileURLToPath } from 'node:url';
import { nodeResolve } from '@rollup/plugin-node-resolve';
import terser from '@rollup/plugin-terser';
import { minifyTemplateLiterals } from 'rollup-plugin-minify-template-literals';

const path = (name) => fileURLToPath(new URL(name, import.meta.url));

const plugins = [
  nodeResolve({ exportConditions: ['production', 'browser'] }),
  minifyTemplateLiterals({ include: [path('./dist/styles.js'), path('./dist/template.js')] }),
  terser({ module: true, ecma: 2022, compress: { passes: 2 }, format: { comments: false } }),
];

/** Chunks carry a hash in their name, so those of earlier builds would pile up. */
const emptyFirst = { name: 'empty-first', buildStart: () => rmSync(path('./cdn'), { recursive: true, force: true }) };

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
    plugins: [emptyFirst, ...plugins],
    output: { ...output, paths: () => './scene-worker.js' },
  },
  {
    input: { 'scene-worker': path('./dist/loading/scene-worker.js') },
    // The page imports `loadScene` from it, so its exports stay; readers import what they share with it from it.
    preserveEntrySignatures: 'allow-extension',
    plugins,
    output,
  },
];
