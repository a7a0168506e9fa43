/** The output of CDNs for an npm package: a single module with all its imports. */
import { build } from 'esbuild';

await build({
  entryPoints: { 'gaussian-splat.min': '@gaussian-splat/element' },
  outdir: 'elsewhere',
  ...{ bundle: true, format: 'esm', minify: true, platform: 'browser' },
});
