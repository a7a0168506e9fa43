/** What CDNs of npm packages make of one: a single module with all that it imports. */
import { build } from 'esbuild';

await build({
  entryPoints: { 'gaussian-splat.min': '@gaussian-splat/element' },
  outdir: 'elsewhere',
  ...{ bundle: true, format: 'esm', minify: true, platform: 'browser' },
});
