/**
 * Writes the decoders of Draco and Basis Universal as modules: the script of each, and its WebAssembly, deflated, in
 * base64. That of meshoptimizer is a module already, but Parcel does not find the parts of packages. A module needs no address, so that a worker from text and every bundler can load it.
 */
import { readFileSync } from 'node:fs';
import { createRequire } from 'node:module';
import { join } from 'node:path';
import { fileURLToPath } from 'node:url';
import { deflateRawSync } from 'node:zlib';
import { build } from 'esbuild';

/** Globals by which the scripts detect pages, workers, Node and loaders of modules. */
const ENVIRONMENT = ['__filename', 'define', 'document', 'exports', 'importScripts', 'module', 'process', 'window'];

/** three.js ships both, pinned with it. */
const LIBS = join(createRequire(import.meta.url).resolve('three/addons/libs/basis/basis_transcoder.js'), '../..');
const DECODERS = {
  'draco-code': ['draco/gltf/draco_wasm_wrapper.js', 'draco/gltf/draco_decoder.wasm', 'DracoDecoderModule'],
  'basis-code': ['basis/basis_transcoder.js', 'basis/basis_transcoder.wasm', 'BASIS'],
};

const OPTIONS = { bundle: true, format: 'esm', platform: 'neutral', minify: true, logLevel: 'warning' };
const inDist = (file) => fileURLToPath(new URL(`../dist/${file}`, import.meta.url));

export async function writeDecoders() {
  const entryPoints = [createRequire(import.meta.url).resolve('meshoptimizer/decoder')];
  await build({ ...OPTIONS, entryPoints, outfile: inDist('gltf/meshopt-code.js') });
  for (const [name, [script, binary, global]] of Object.entries(DECODERS)) {
    const wasm = deflateRawSync(readFileSync(join(LIBS, binary)), { level: 9 }).toString('base64');
    await build({
      stdin: {
        contents: `export { default as create } from './${script}';\nexport const wasm = '${wasm}';`,
        resolveDir: LIBS,
      },
      ...{ ...OPTIONS, outfile: inDist(`triangles/${name}.js`) },
      plugins: [asModule(global)],
      // The scripts look for the environment that loads their WebAssembly: they get it from the reader.
      define: Object.fromEntries(ENVIRONMENT.map((global) => [global, 'undefined'])),
    });
  }
}

/** Makes a module of a script. Its branches for Node would make bundlers look for Node's modules. */
const asModule = (name) => ({
  name: 'as-module',
  setup({ onLoad }) {
    onLoad({ filter: /draco_wasm_wrapper|basis_transcoder/ }, ({ path }) => {
      const code = readFileSync(path, 'utf8').replace(/\brequire\("(fs|path)"\)/g, 'undefined');
      return { contents: `${code}\nexport default ${name};` };
    });
  },
});
