/**
 * Small apps as their own tools make them, with nothing configured for the element. Each is a folder beside this file, copied and installed by
 * `npm run test:apps` (scripts/apps.mjs).
 *
 * @typedef {object} App
 * @property {string} [folder] of its files; default: its name
 * @property {Record<string, string>} dependencies exact versions; those on our packages are taken from the release
 * @property {string[]} [build] the command that makes `output` of it
 * @property {string} [output] folder that a static server then serves, or a page that is opened from the disk
 * @property {boolean} [hasGenerator] whether it also shows a generator; default: true, unless `output` is a page
 * @property {RegExp} [faults] allowed console messages: the browser's reports of a policy's refusals
 * @property {string[]} [dev] its development server, `PORT` being a free port
 * @property {number} [most] bytes of gzip of a visit without a visitor, with camera controls, the SPZ reader, the self-test of the GPU, previews and the quality of frames in motion. How many of them come before the image is printed, not tested: it depends on the machine
 */

const ELEMENT = { '@gaussian-splat/element': 'release' };
const REACT = { '@gaussian-splat/react': 'release', react: '19.3.1', 'react-dom': '19.3.1' };

/** For tools that ask for a later Node than this repository does. */
const NODE = { node: '22.23.3' };

/** @type {Record<string, App>} */
export const APPS = {
  single: {
    dependencies: {},
    build: ['node', 'ROOT/packages/cli/bin/gaussian-splat.mjs', 'page', 'scene.spz', 'page', '--single'],
    output: 'page/index.html',
  },
  cdn: {
    folder: 'cdn-page',
    dependencies: ELEMENT,
    build: ['node', 'build.mjs'],
    output: '.',
    most: 129_900,
  },
  'esm-cdn': { dependencies: { ...ELEMENT, esbuild: '0.28.2' }, build: ['node', 'build.mjs'], output: '.' },
  esbuild: {
    dependencies: { ...ELEMENT, esbuild: '0.28.2' },
    build: ['npx', 'esbuild', 'main.js', '--bundle', '--splitting', '--format=esm', '--minify', '--outdir=dist'],
    output: '.',
  },
  'esbuild-iife': {
    folder: 'esbuild',
    dependencies: { ...ELEMENT, esbuild: '0.28.2' },
    build: ['npx', 'esbuild', 'main.js', '--bundle', '--minify', '--outdir=dist'],
    output: '.',
  },
  rollup: {
    dependencies: { ...ELEMENT, rollup: '4.67.4', '@rollup/plugin-node-resolve': '16.0.3' },
    build: ['npx', 'rollup', '-p', 'node-resolve', '-i', 'main.js', '-d', 'dist', '--silent'],
    output: '.',
  },
  vite: {
    folder: 'vite',
    dependencies: { ...ELEMENT, vite: '8.3.8' },
    build: ['npx', 'vite', 'build'],
    output: 'dist',
    most: 138_900,
  },
  'vite-policy': {
    dependencies: { ...ELEMENT, vite: '8.3.8' },
    build: ['npx', 'vite', 'build'],
    output: 'dist',
    // ONNX Runtime is WebAssembly, which this policy refuses.
    hasGenerator: false,
    // The worker as text is refused; the file that Vite has emitted is not.
    faults: /blob:.*Content Security Policy|Content Security Policy.*blob:/,
  },
  'vite8-react': {
    folder: 'vite-react',
    dependencies: { ...REACT, vite: '8.3.8', '@vitejs/plugin-react': '6.3.0' },
    build: ['npx', 'vite', 'build'],
    output: 'dist',
    dev: ['npx', 'vite', '--port', 'PORT', '--strictPort'],
  },
  'vite7-react': {
    folder: 'vite-react',
    dependencies: { ...REACT, vite: '7.3.8', '@vitejs/plugin-react': '5.2.0' },
    build: ['npx', 'vite', 'build'],
    output: 'dist',
    dev: ['npx', 'vite', '--port', 'PORT', '--strictPort'],
  },
  preact: {
    dependencies: {
      ...{ ...ELEMENT, preact: '11.2.0', vite: '8.3.8', '@preact/preset-vite': '2.10.6' },
      typescript: '6.0.3',
    },
    build: ['sh', '-c', 'npx tsc --noEmit && npx vite build'],
    output: 'dist',
    dev: ['npx', 'vite', '--port', 'PORT', '--strictPort'],
  },
  solid: {
    dependencies: {
      ...{ ...ELEMENT, 'solid-js': '1.9.20', vite: '8.3.8', 'vite-plugin-solid': '2.11.14' },
      typescript: '6.0.3',
    },
    build: ['sh', '-c', 'npx tsc --noEmit && npx vite build'],
    output: 'dist',
  },
  'react-router': {
    dependencies: {
      ...{ ...REACT, ...NODE, vite: '8.3.8', isbot: '5.2.3' },
      ...{ 'react-router': '8.4.0', '@react-router/dev': '8.4.0', '@react-router/node': '8.4.0' },
    },
    build: ['npx', 'react-router', 'build'],
    output: 'build/client',
  },
  rsbuild: {
    dependencies: { ...REACT, '@rsbuild/core': '2.3.2', '@rsbuild/plugin-react': '2.1.1' },
    build: ['npx', 'rsbuild', 'build'],
    output: 'dist',
  },
  webpack: {
    dependencies: { ...ELEMENT, webpack: '5.112.2', 'webpack-cli': '7.3.1' },
    build: ['npx', 'webpack', '--mode', 'production', '--output-public-path', 'auto'],
    output: '.',
  },
  rspack: {
    folder: 'webpack',
    dependencies: { ...ELEMENT, '@rspack/core': '2.3.4', '@rspack/cli': '2.2.8' },
    build: ['npx', 'rspack', 'build', '--mode', 'production'],
    output: '.',
  },
  parcel: {
    dependencies: { ...ELEMENT, parcel: '2.16.4' },
    build: ['npx', 'parcel', 'build', 'index.html', '--public-url', './', '--no-cache'],
    output: 'dist',
  },
  'next-turbopack': {
    folder: 'next',
    dependencies: { ...REACT, next: '16.4.6' },
    build: ['npx', 'next', 'build'],
    output: 'out',
  },
  'next-webpack': {
    folder: 'next',
    dependencies: { ...REACT, next: '16.4.6' },
    build: ['npx', 'next', 'build', '--webpack'],
    output: 'out',
  },
  nuxt: {
    dependencies: { ...ELEMENT, ...NODE, nuxt: '4.4.8', vue: '3.5.45' },
    build: ['npx', 'nuxt', 'generate'],
    output: '.output/public',
    dev: ['npx', 'nuxt', 'dev', '--port', 'PORT'],
    most: 186_500,
  },
  astro: {
    dependencies: { ...ELEMENT, ...NODE, astro: '6.0.5' },
    build: ['npx', 'astro', 'build'],
    output: 'dist',
    dev: ['npx', 'astro', 'dev', '--port', 'PORT'],
  },
  sveltekit: {
    dependencies: {
      ...{ ...ELEMENT, ...NODE },
      ...{ '@sveltejs/kit': '3.2.0', '@sveltejs/adapter-static': '4.0.1', svelte: '5.57.3', vite: '8.3.8' },
      '@sveltejs/vite-plugin-svelte': '7.3.1',
    },
    build: ['npx', 'vite', 'build'],
    output: 'build',
  },
  jsdom: {
    dependencies: { ...ELEMENT, ...NODE, vitest: '5.1.2', jsdom: '31.0.1' },
    build: ['npx', 'vitest', 'run', '--environment', 'jsdom'],
  },
  angular: {
    dependencies: {
      ...{ ...ELEMENT, ...NODE },
      ...Object.fromEntries(
        ['common', 'compiler', 'compiler-cli', 'core', 'platform-browser'].map((name) => [
          `@angular/${name}`,
          '22.2.6',
        ]),
      ),
      ...{ '@angular/build': '22.2.7', '@angular/cli': '22.2.7', rxjs: '7.8.0', typescript: '6.0.3', tslib: '2.9.1' },
    },
    build: ['npx', 'ng', 'build'],
    output: 'dist/app/browser',
  },
};
