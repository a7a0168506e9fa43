/** The chunks of the worker's code as modules that export their text, and the list of them: see src/loading/worker-sources.ts. */
import { basename } from 'node:path';

/**
 * Prefix of the functions that one chunk calls in another. No name in the code has it, because such a name would be
 * called instead.
 */
const LOAD = 'gaussianSplatChunk';

/** For an output of Rollup in the format `cjs`, whose `require` and `exports` the worker brings. */
export const workerAsText = {
  name: 'worker-as-text',
  outputOptions: (options) => ({
    ...options,
    ...{
      exports: 'named',
      esModule: false,
      interop: 'esModule',
      freeze: false,
      strict: false,
      generatedCode: 'es2015',
    },
    ...{ entryFileNames: '[name].js', chunkFileNames: '[name].js', externalLiveBindings: false },
  }),
  renderDynamicImport: () => ({ left: `${LOAD}(`, right: ')' }),
  // It has no address, so there is nothing beside it.
  resolveImportMeta: () => 'undefined',
  generateBundle(_, bundle) {
    const chunks = Object.values(bundle).filter(({ type }) => type === 'chunk');
    const list = chunks.map(({ fileName }) => {
      const file = `./worker-code/${basename(fileName)}`;
      return `  './${fileName}': { needs: ${JSON.stringify(needsOf(fileName, bundle))}, load: () => import('${file}') },\n`;
    });
    for (const chunk of chunks) {
      delete bundle[chunk.fileName];
      const text = `"./${chunk.fileName}":(exports,require,${LOAD})=>{${chunk.code.trim()}}`;
      const source = `export default ${JSON.stringify(text)};\n`;
      this.emitFile({ type: 'asset', fileName: `worker-code/${basename(chunk.fileName)}`, source });
    }
    this.emitFile({
      type: 'asset',
      fileName: 'worker-code.js',
      source: `export const CHUNKS = {\n${list.join('')}};\n`,
    });
  },
};

/** Chunks that must be loaded before a chunk, dependencies first. */
function needsOf(fileName, bundle, found = new Set([fileName])) {
  for (const each of bundle[fileName].imports) {
    if (found.has(each)) continue;
    found.add(each);
    needsOf(each, bundle, found);
  }
  return [...found].filter((name) => name !== fileName).map((name) => `./${name}`);
}
