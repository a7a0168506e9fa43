/**
 * `npm run lab -- wgpu [PATTERN]`: the golden tests on wgpu, the WebGPU of Firefox, in Deno. Without a GPU that is Mesa's lavapipe (Debian: mesa-vulkan-drivers). Deno is installed from
 * npm into `.cache/wgpu` on the first run. After `npm run build -- --packages`. Not part of `npm test`: lavapipe takes up to seven minutes to a file. `TESTS=lab` also runs each file's laboratory part.
 */
import { spawnSync } from 'node:child_process';
import { existsSync, mkdirSync, readdirSync, writeFileSync } from 'node:fs';
import { join } from 'node:path';
import { root } from './lib/run.mjs';

const DENO = '2.9.6';
const CACHE = join(root, '.cache/wgpu');
const LAVAPIPE = '/usr/share/vulkan/icd.d/lvp_icd.x86_64.json';
/** Files with tests that fail on wgpu and lavapipe, and why. */
const KNOWN = {
  invariants: `Deno ${DENO} panics in ext/webgpu/queue.rs at an image of no splats`,
  'short-shaders': 'it expects quads in rgba16float to pass the self-test, which refuses those of lavapipe',
  variants: 'the same, and wgpu reports a buffer of a lost device as invalid',
};
const OPTIONS = ['--allow-all', '--no-check', '--unstable-webgpu', '--unstable-sloppy-imports'];
const FILE_MS = 1_800_000;

const [pattern = ''] = process.argv.slice(2);
const files = readdirSync(join(root, 'tests/golden')).filter(
  (name) => name.endsWith('.test.ts') && name.includes(pattern),
);
if (files.length === 0) {
  console.error(`No test file in tests/golden has "${pattern}" in its name.`);
  process.exit(2);
}
const deno = ensureDeno();
console.log(`Deno ${DENO}, ${existsSync(LAVAPIPE) ? 'lavapipe' : "the machine's own GPU"}`);
const failed = files.filter((file) => !runFile(file));
console.log(`${files.length - failed.length} of ${files.length} files are as they should be`);
console.log(
  'Not covered: the element and its pages, stages (tests/stages), Firefox itself, a GPU where lavapipe draws, and rows that say skipped or known.',
);
process.exit(failed.length > 0 ? 1 : 0);

/** Whether a file holds on wgpu, or fails as is known. */
function runFile(file) {
  const imports = join(root, 'scripts/wgpu/imports.json');
  const drivers = existsSync(LAVAPIPE) ? { VK_DRIVER_FILES: LAVAPIPE, VK_ICD_FILENAMES: LAVAPIPE } : {};
  const { status, stdout, stderr } = spawnSync(
    deno,
    ['test', ...OPTIONS, '--import-map', imports, join('tests/golden', file)],
    { cwd: root, env: { ...process.env, NO_COLOR: '1', ...drivers }, encoding: 'utf8', timeout: FILE_MS },
  );
  const known = KNOWN[file.replace(/(\.alone)?(\.lab)?\.test\.ts$/, '')];
  const [, counts] = /(\d+ passed.*\d+ (?:failed|ignored))/.exec(stdout) ?? [];
  const name = `${file}: ${counts ?? 'no tests'}`;
  const holds = status === 0 && counts !== undefined;
  if (holds) console.log(`${counts.startsWith('0 ') ? 'skipped' : 'ok     '} ${name}`);
  else if (known) console.log(`known   ${name}: ${known}`);
  else console.log(`FAILED  ${name}\n${(stdout + stderr).slice(-4000)}`);
  return holds || known !== undefined;
}

function ensureDeno() {
  const executable = join(CACHE, 'node_modules/.bin/deno');
  mkdirSync(CACHE, { recursive: true });
  writeFileSync(join(CACHE, 'package.json'), JSON.stringify({ private: true, dependencies: { deno: DENO } }));
  if (existsSync(executable)) return executable;
  const words = ['install', '--no-audit', '--no-fund', '--loglevel=error'];
  if (spawnSync('npm', words, { cwd: CACHE, stdio: 'inherit' }).status !== 0) process.exit(1);
  return executable;
}
