/** The script of a thread, in one file: a thread that loads a hundred modules, as every one of sixteen does, takes five times as long to start. */
import { existsSync } from 'node:fs';
import { fileURLToPath } from 'node:url';

const SOURCE = new URL('./task-thread.mjs', import.meta.url);
const BUNDLE = new URL('../../../../.cache/threads/task-thread.mjs', import.meta.url);

/** Where it is: what the last build made of it, else its source. */
export const threadScript = () => (existsSync(BUNDLE) ? BUNDLE : SOURCE);

/** Makes it, once the packages are built. */
export async function bundleThreadScript() {
  const { build } = await import('esbuild');
  await build({
    entryPoints: [fileURLToPath(SOURCE)],
    outfile: fileURLToPath(BUNDLE),
    bundle: true,
    format: 'esm',
    platform: 'node',
    logLevel: 'warning',
  });
}
