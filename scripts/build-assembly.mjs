/**
 * Compiles packages/renderer/assembly/pack-rows.ts (AssemblyScript) to WebAssembly, as a module of packages/renderer/src/generated/. A module needs no address, so
 * that a worker from text and every bundler can load it.
 */
import { createHash } from 'node:crypto';
import { existsSync, mkdirSync, readFileSync, writeFileSync } from 'node:fs';
import { dirname, join } from 'node:path';
import { root } from './lib/run.mjs';

const SOURCE = 'packages/renderer/assembly/pack-rows.ts';
const TARGET = join(root, 'packages/renderer/src/generated/pack-rows.ts');
const OPTIONS = [
  '-O3',
  '--enable',
  'simd',
  '--runtime',
  'stub',
  '--importMemory',
  '--noAssert',
  '--outFile',
  'out.wasm',
];

const { version } = JSON.parse(readFileSync(join(root, 'node_modules/assemblyscript/package.json'), 'utf8'));
const inputs = [version, OPTIONS.join(' '), readFileSync(join(root, SOURCE), 'utf8')];
const stamp = `// ${createHash('sha256').update(inputs.join('\n')).digest('hex')}`;

// Loading the compiler takes longer than checking that its result is current.
if (!existsSync(TARGET) || !readFileSync(TARGET, 'utf8').startsWith(stamp)) {
  const { default: asc } = await import('assemblyscript/asc');
  let wasm;
  const { error, stderr } = await asc.main([SOURCE, ...OPTIONS], {
    readFile: (name, base) => {
      const path = join(root, base === '.' ? '' : base, name);
      return existsSync(path) ? readFileSync(path, 'utf8') : null;
    },
    writeFile: (name, contents) => {
      if (name === 'out.wasm') wasm = contents;
    },
    listFiles: () => [],
  });
  if (error) {
    console.error(stderr.toString());
    process.exit(1);
  }
  mkdirSync(dirname(TARGET), { recursive: true });
  const text = Buffer.from(wasm).toString('base64');
  writeFileSync(
    TARGET,
    `${stamp}\n/** WebAssembly of ${SOURCE}, in base64. */\nexport const ROWS_WASM =\n  '${text}';\n`,
  );
}
