/**
 * The CDN build: `cdn/gaussian-splat.min.js` (the element and the renderer in one file, for a script tag with an
 * integrity attribute), and beside it the scene worker with a chunk for every reader, which it finds from its own URL.
 * And for bundlers, in the package: the worker as text, a module for each chunk (src/loading/worker-sources.ts); and the element as
 * short as for CDNs, for those that build for production. Scripts of one file: rolldown.config.mjs.
 */
import { cpSync, mkdirSync, readFileSync } from 'node:fs';
import { createRequire } from 'node:module';
import { dirname, join } from 'node:path';
import { fileURLToPath } from 'node:url';
import { RUNTIME_FILES } from '@gaussian-splat/generator';
import { nodeResolve } from '@rollup/plugin-node-resolve';
import terser from '@rollup/plugin-terser';
import { minifyTemplateLiterals } from 'rollup-plugin-minify-template-literals';
import { shortShaders } from './scripts/shader-plugin.mjs';
import { minifySync } from 'rolldown/utils';
import { workerAsText } from './scripts/worker-text.mjs';

/**
 * These modules of the package stay separate: they find files by their own address, belong to the worker, or are
 * generated here.
 */
const KEPT = /\/element\/dist\/(loading\/(worker-sources|spawn-worker|scene-worker)|sources\/mesh\/three)\.js$/;

const path = (name) => fileURLToPath(new URL(name, import.meta.url));

/** three.js, as much of it as meshes need, is one file of the CDN build. The package's own module is that file, whose types stay with the sources. */
const THREE = 'three.js of the CDN build';
export const THREE_OF_PACKAGE = path('./dist/sources/mesh/three.js');
const threeBeside = {
  name: 'three-beside',
  resolveId: (id, importer) =>
    id === './three.js' && importer?.startsWith(path('./dist/sources/mesh/')) ? { id: THREE, external: true } : null,
};

/** All arguments of the element's viewpoints are its own: its bundles need no checks. */
const CHECKS = path('../renderer/dist/checks.js');
const unchecked = {
  name: 'unchecked',
  load: (id) => (id === CHECKS ? `export * from './unchecked.js'` : null),
};

/** Resolves and changes the package's modules. Not for minifiers. */
export const sources = [
  unchecked,
  nodeResolve({ exportConditions: ['production', 'browser'] }),
  shortShaders(),
  minifyTemplateLiterals({
    include: [
      'viewer/styles',
      'viewer/template',
      'viewer/corner-button',
      'features/input/hands-view',
      'features/views/tour',
      'features/labels/hotspot-controller',
      'features/auto-rotate/motion-controller',
      'sources/generator/controls-panel',
    ].map((name) => path(`./dist/${name}.js`)),
  }),
];
/** A bundler of an app replaces an import whose address it does not know by one that throws, unless a comment in it says otherwise. */
const UNKNOWN_IMPORT = /\bimport\(([\w$]+)\)/g;
export const keepImports = (code) =>
  code.replace(UNKNOWN_IMPORT, 'import(/* @vite-ignore */ /* webpackIgnore: true */ $1)');

/** Oxc is within half a percent of Terser, and takes 1 CPU second for all chunks, not 60. */
const short = {
  name: 'short',
  renderChunk(code, { fileName }, { sourcemap }) {
    const { errors, ...made } = minifySync(fileName, code, {
      ...{ module: true, mangle: { toplevel: true }, sourcemap: Boolean(sourcemap) },
      // No property is read here for what its getter does.
      compress: { target: 'es2022', treeshake: { propertyReadSideEffects: false } },
    });
    if (errors.length > 0) throw new Error(`${fileName}: ${errors[0].message}`);
    if (sourcemap) return made;
    return { code: keepImports(made.code) };
  },
};

/** Terser's options for what a page always loads of the CDN build: together with Oxc, it saves 500 bytes of gzip. */
const SHORT = { module: true, ecma: 2022 };
const shorter = terser({
  ...SHORT,
  // Oxc names the variables. Statements compress better than what they can be joined to with commas.
  ...{ mangle: false, compress: { sequences: false, inline: 1, keep_fargs: false, pure_getters: true } },
});
const shorterFirst = {
  name: 'shorter-first',
  renderChunk(code, chunk, options, ...rest) {
    return chunk.isEntry && options.sourcemap ? shorter.renderChunk.call(this, code, chunk, options, ...rest) : null;
  },
};

/** Minimum number of exports that other chunks import, for a second pass of Terser. */
const MANY_EXPORTS = 20;
/**
 * Names variables as Rollup has named their exports, so that the list of exports has no pairs: 380 bytes of gzip less for
 * the element's script.
 */
const exportedNames = {
  name: 'exported-names',
  renderChunk(code, ...rest) {
    const [, list = ''] = /\bexport\{([^}]*)\}/.exec(code) ?? [];
    const pairs = list.split(',').map((each) => each.split(' as '));
    const short = pairs.filter(([, exported]) => exported?.length <= 2);
    if (short.length < MANY_EXPORTS) return null;
    const props = Object.fromEntries(short.map(([variable, exported]) => [`$${variable}`, exported]));
    return terser({ ...SHORT, compress: false, nameCache: { vars: { props } } }).renderChunk.call(this, code, ...rest);
  },
};

const plugins = [...sources, shorterFirst, short, exportedNames];

/** Here the worker's script lies beside the element's. */
const workerBeside = {
  name: 'worker-beside',
  load: (id) => (id === path('./dist/loading/worker-sources.js') ? `export * from './worker-sources-cdn.js'` : null),
};

/** ONNX Runtime for generators, which other pages do not fetch; and the page for iframes. */
const copyOthers = {
  name: 'copy-others',
  writeBundle() {
    cpSync(path('./embed'), path('./cdn'), { recursive: true });
    const from = dirname(createRequire(import.meta.url).resolve('onnxruntime-web/webgpu'));
    mkdirSync(path('./cdn/onnxruntime'), { recursive: true });
    for (const file of RUNTIME_FILES) cpSync(join(from, file), path(`./cdn/onnxruntime/${file}`));
  },
};

/** Name of a chunk's content; the package's name if the module's name is not specific. */
const NAMES = { index: 'generator', dist: 'generator', meta: 'sog-meta', lod: 'sog-levels', bundle: 'sog-bundle' };
const nameOf = ({ name }) => NAMES[name] ?? name;

const output = {
  dir: path('./cdn'),
  format: 'es',
  // The package has no maps, which scripts would ask for.
  sourcemap: 'hidden',
  chunkFileNames: (chunk) => `readers/${nameOf(chunk)}-[hash].js`,
};

/** Modules that are loaded together: as one chunk they take a quarter less than as many, and one request. */
const TOGETHER = {
  packing:
    /\/(renderer\/dist\/pack\/(joined-blocks|morton|pack|pack-cloud|radix-sort|recenter|unpack)|element\/dist\/loading\/pack-cloud|core\/dist\/(linear|vector|views\/[^/]+))\.js$/,
  previews: /\/(formats\/dist\/read-prefix|element\/dist\/loading\/preview-schedule)\.js$/,
  reading: /\/formats\/dist\/(credits|decompression|faults|preview|safe-orbit)\.js$/,
};
const together = {
  onlyExplicitManualChunks: true,
  manualChunks: (id) => Object.keys(TOGETHER).find((name) => TOGETHER[name].test(id)),
};

/** Parts of the build, which the variable PART names, and which may run at the same time. */
const PARTS = {
  page: [
    {
      input: { 'gaussian-splat.min': path('./dist/index.js') },
      // If workers are forbidden, the element imports the worker's module, which is the same file, not a copy.
      external: (id) => id.endsWith('scene-worker.js'),
      // The code for generators is a separate chunk, loaded for the first generator. It loads the runtime from its own
      // folder.
      preserveEntrySignatures: 'allow-extension',
      plugins: [workerBeside, threeBeside, ...plugins, copyOthers],
      // Code that two chunks share, and that is smaller than a request for it, is added to a chunk that the page always
      // loads.
      output: {
        ...output,
        chunkFileNames: (chunk) => `${nameOf(chunk)}-[hash].js`,
        paths: (id) =>
          id === THREE ? `./${/three-[^']+/.exec(readFileSync(THREE_OF_PACKAGE, 'utf8'))[0]}` : './scene-worker.js',
        experimentalMinChunkSize: 500,
      },
    },
    {
      input: {
        index: path('./dist/index.js'),
        element: path('./dist/viewer/element.js'),
        scenes: path('./dist/scenes.js'),
      },
      // Imports for nothing but their effects, which these do not have, would make bundlers warn.
      treeshake: { moduleSideEffects: (_, isExternal) => !isExternal },
      // Lit and the errors' class may be the app's own, too.
      external: (id) => /^(lit|@lit|@gaussian-splat\/core(\/contract|\/onnx|\/fetch)?$)/.test(id) || KEPT.test(id),
      plugins,
      output: {
        ...{ dir: path('./dist'), format: 'es', experimentalMinChunkSize: 500, hoistTransitiveImports: false },
        entryFileNames: 'production/[name].js',
        chunkFileNames: (chunk) => `production/${nameOf(chunk)}.js`,
      },
    },
  ],
  worker: [
    {
      input: { 'scene-worker': path('./dist/loading/scene-worker.js') },
      // The page imports `runOnPage` from it, so its exports stay; readers import what they share with it from it.
      preserveEntrySignatures: 'allow-extension',
      plugins,
      output: [
        { ...output, ...together },
        { dir: path('./dist/loading'), format: 'cjs', plugins: [workerAsText], ...together },
      ],
    },
  ],
};

export default PARTS[process.env.PART];
