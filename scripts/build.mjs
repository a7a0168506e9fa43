/** `npm run build`: shaders to typed constants, TypeScript to packages, the CDN bundle, and the demo as a static site. */
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
await buildDemo();

function projects() {
  return ['core', 'formats', 'renderer', 'generator', 'check', 'economise', 'element'].map(
    (name) => `packages/${name}`,
  );
}

/** demo/dist is the whole site: any static host can serve it. */
async function buildDemo() {
  const from = join(root, 'demo');
  const to = join(root, 'demo/dist');
  rmSync(to, { recursive: true, force: true });
  mkdirSync(to, { recursive: true });
  for (const name of readdirSync(from)) {
    if (name !== 'dist' && name !== 'bench') cpSync(join(from, name), join(to, name), { recursive: true });
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
  if (!existsSync(join(to, 'index.html'))) throw new Error('demo/index.html is missing');
}
