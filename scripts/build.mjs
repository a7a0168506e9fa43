/** `npm run build`: shaders to typed constants, TypeScript to packages, the CDN bundle, and the demo as a static site. */
import { cpSync, existsSync, mkdirSync, rmSync } from 'node:fs';
import { join } from 'node:path';
import { ensureDependencies } from './lib/prepare.mjs';
import { must, root } from './lib/run.mjs';

ensureDependencies();
must(process.execPath, ['scripts/build-shaders.mjs']);
must(process.execPath, ['node_modules/typescript/bin/tsc', '--build', ...projects()]);
must(process.execPath, ['node_modules/rollup/dist/bin/rollup', '--config', 'packages/element/rollup.config.mjs', '--silent']);
buildDemo();

function projects() {
  return ['core', 'formats', 'renderer', 'element'].map((name) => `packages/${name}`);
}

/** demo/dist is the whole site: any static host can serve it. */
function buildDemo() {
  const from = join(root, 'demo');
  const to = join(root, 'demo/dist');
  rmSync(to, { recursive: true, force: true });
  mkdirSync(to, { recursive: true });
  cpSync(from, to, { recursive: true, filter: (path) => path !== to && !path.startsWith(`${to}/`) });
  cpSync(join(root, 'packages/element/cdn'), join(to, 'cdn'), { recursive: true });
  if (!existsSync(join(to, 'index.html'))) throw new Error('demo/index.html is missing');
}
