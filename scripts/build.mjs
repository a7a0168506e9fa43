/** `npm run build`: shaders to typed constants, TypeScript to packages, the CDN bundle, what editors know of the element, and the demo as a static site. */
import { cpSync, existsSync, mkdirSync, readdirSync, rmSync } from 'node:fs';
import { join } from 'node:path';
import { ensureDependencies } from './lib/prepare.mjs';
import { must, root } from './lib/run.mjs';

ensureDependencies();
must(process.execPath, ['scripts/build-shaders.mjs']);
must(process.execPath, ['node_modules/typescript/bin/tsc', '--build', ...projects()]);
must(process.execPath, [
  'node_modules/rollup/dist/bin/rollup',
  '--config',
  'packages/element/rollup.config.mjs',
  '--silent',
]);
describeElement();
await buildDemo();

/** Folders of the demo that frameworks build with their own tools. */
function apps() {
  return ['react', 'vue'];
}

function projects() {
  return ['core', 'formats', 'renderer', 'generator', 'check', 'economise', 'element', 'react'].map(
    (name) => `packages/${name}`,
  );
}

/** What editors and tools know of the element, from its sources. */
function describeElement() {
  const analyzer = join(root, 'node_modules/@custom-elements-manifest/analyzer/cem.js');
  const config = 'custom-elements-manifest.config.mjs';
  must(process.execPath, [analyzer, 'analyze', '--quiet', '--config', config], { cwd: join(root, 'packages/element') });
}

/** demo/dist is the whole site: any static host can serve it. */
async function buildDemo() {
  const from = join(root, 'demo');
  const to = join(root, 'demo/dist');
  rmSync(to, { recursive: true, force: true });
  mkdirSync(to, { recursive: true });
  for (const name of readdirSync(from)) {
    if (!['dist', 'bench', ...apps()].includes(name)) cpSync(join(from, name), join(to, name), { recursive: true });
  }
  cpSync(join(root, 'packages/element/cdn'), join(to, 'cdn'), { recursive: true });
  cpSync(join(root, 'docs/stability'), join(to, 'stability/data'), { recursive: true });
  // Its packages were not there when this script started on a fresh clone.
  const { bundleBench } = await import('./lib/bundle-bench.mjs');
  await bundleBench(join(to, 'bench'));
  const { build } = await import('esbuild');
  for (const script of ['check/check.js', 'examples/examples.js']) {
    await build({
      entryPoints: [join(from, script)],
      outfile: join(to, script),
      allowOverwrite: true,
      bundle: true,
      format: 'esm',
      minify: true,
      logLevel: 'warning',
    });
  }
  for (const app of apps()) {
    const config = join(from, app, 'vite.config.mjs');
    must(process.execPath, ['node_modules/vite/bin/vite.js', 'build', '--config', config, '--logLevel', 'warn']);
  }
  if (!existsSync(join(to, 'index.html'))) throw new Error('demo/index.html is missing');
}
