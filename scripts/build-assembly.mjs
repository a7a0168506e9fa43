/**
 * Compiles files of packages/NAME/assembly (AssemblyScript) to WebAssembly, as modules of packages/NAME/src/generated/. A module needs no address, so that a worker from
 * text and every bundler can load it.
 */
import { createHash } from 'node:crypto';
import { existsSync, mkdirSync, readFileSync, writeFileSync } from 'node:fs';
import { dirname, join } from 'node:path';
import { root } from './lib/run.mjs';

const MODULES = [
  { source: 'packages/renderer/assembly/pack-rows.ts', name: 'rowsWasm' },
  { source: 'packages/renderer/assembly/pack-nodes.ts', name: 'nodesWasm' },
  { source: 'packages/formats/assembly/unpack-splats.ts', name: 'unpackWasm' },
];
/** Files that those of the modules import. */
const SHARED = ['packages/core/assembly/exp.ts', 'packages/renderer/assembly/shared.ts'];
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

/** Hexadecimal digits, because gzip finds equal bytes in them, which base64 hides: a quarter less. Not all browsers have `fromHex` yet. */
const moduleOf = (source, name, digits) => `const DIGITS = '${digits}';
const { fromHex } = Uint8Array as { fromHex?: (digits: string) => Uint8Array<ArrayBuffer> };

/** Returns the WebAssembly of ${source}. */
export const ${name} = (): Uint8Array<ArrayBuffer> =>
  fromHex?.call(Uint8Array, DIGITS) ?? Uint8Array.from(DIGITS.match(/../g)!, (byte) => parseInt(byte, 16));
`;

const { version } = JSON.parse(readFileSync(join(root, 'node_modules/assemblyscript/package.json'), 'utf8'));

for (const { source, name } of MODULES) {
  const target = join(root, source.replace('/assembly/', '/src/generated/'));
  const inputs = [
    version,
    OPTIONS.join(' '),
    moduleOf(source, name, ''),
    ...[source, ...SHARED].map((file) => readFileSync(join(root, file), 'utf8')),
  ];
  const stamp = `// ${createHash('sha256').update(inputs.join('\n')).digest('hex')}`;
  // Loading the compiler takes longer than checking that its result is current.
  if (existsSync(target) && readFileSync(target, 'utf8').startsWith(stamp)) continue;
  const { default: asc } = await import('assemblyscript/asc');
  let wasm;
  const { error, stderr } = await asc.main([source, ...OPTIONS], {
    readFile: (file, base) => {
      const path = join(root, base === '.' ? '' : base, file);
      return existsSync(path) ? readFileSync(path, 'utf8') : null;
    },
    writeFile: (file, contents) => {
      if (file === 'out.wasm') wasm = contents;
    },
    listFiles: () => [],
  });
  if (error) {
    console.error(stderr.toString());
    process.exit(1);
  }
  mkdirSync(dirname(target), { recursive: true });
  writeFileSync(target, `${stamp}\n${moduleOf(source, name, Buffer.from(wasm).toString('hex'))}`);
}
