/**
 * `npm run lab -- NAME [OPTIONS]`: a measurement of the laboratory, once all that it needs is installed and built. Without a name it lists them. docs/benchmark.md and docs/stability.md
 * say what each of them measures; `--help` of most prints their options.
 */
import { ensureChromium, findSwiftShader } from './lib/chromium.mjs';
import { gpuEnvironment } from './lib/gpu-environment.mjs';
import { ensureBuilt, ensureDependencies } from './lib/prepare.mjs';
import { run } from './lib/run.mjs';
import { COMMANDS } from './lib/lab-commands.mjs';

const [name, ...args] = process.argv.slice(2);
if (!Object.hasOwn(COMMANDS, name ?? '')) {
  if (name !== undefined) console.error(`npm run lab: no measurement is named ${name}.`);
  const width = Math.max(...Object.keys(COMMANDS).map(({ length }) => length));
  console.log('usage: npm run lab -- NAME [OPTIONS]\n');
  for (const [key, { what }] of Object.entries(COMMANDS)) console.log(`  ${key.padEnd(width)}  ${what}`);
  process.exit(name === undefined ? 0 : 1);
}

const { command, in: place } = COMMANDS[name];
if (place !== undefined) {
  ensureDependencies();
  ensureBuilt();
}
if (place === 'chromium') process.env.CHROMIUM = ensureChromium();
// On Linux, Dawn in Node uses the SwiftShader that comes with Chromium.
const isSoftware = process.platform === 'linux' && process.env.GAUSSIAN_SPLAT_GPU !== 'system';
if (place === 'dawn' && isSoftware && !findSwiftShader()) ensureChromium();
process.exit(run(process.execPath, [...command, ...args], place === 'dawn' ? { env: gpuEnvironment() } : {}));
