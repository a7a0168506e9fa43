/** The main entries of packages export what applications use, and no more: the rest has subpaths. */
import assert from 'node:assert/strict';
import { existsSync, readFileSync } from 'node:fs';
import { test } from 'node:test';
import { fileURLToPath } from 'node:url';
import ts from 'typescript';

interface Manifest {
  readonly files: readonly string[];
  readonly exports: Readonly<Record<string, { readonly default?: string }>>;
}

const MAX_NAMES = { core: 60, renderer: 70, optimize: 60 };

const entryOf = (name: string): string =>
  fileURLToPath(new URL(`../../packages/${name}/dist/index.d.ts`, import.meta.url));
const program = ts.createProgram(Object.keys(MAX_NAMES).map(entryOf), {
  ...{ module: ts.ModuleKind.NodeNext, moduleResolution: ts.ModuleResolutionKind.NodeNext },
  ...{ noEmit: true, noLib: true, types: [] },
});

for (const [name, max] of Object.entries(MAX_NAMES)) {
  test(`@gaussian-splat/${name} exports at most ${max} names, values and types together`, () => {
    const symbol = program.getTypeChecker().getSymbolAtLocation(program.getSourceFile(entryOf(name))!);
    const names = program
      .getTypeChecker()
      .getExportsOfModule(symbol!)
      .map((exported) => exported.name);
    console.log(`${name}: ${names.length} names`);
    assert.ok(names.length > 20 && names.length <= max, names.sort().join(' '));
  });
}

for (const name of ['core', 'formats', 'generator', 'renderer', 'element', 'react']) {
  test(`bundlers that do not read exports find every entry of @gaussian-splat/${name}`, () => {
    const folder = fileURLToPath(new URL(`../../packages/${name}/`, import.meta.url));
    const { exports, files } = JSON.parse(readFileSync(`${folder}package.json`, 'utf8')) as Manifest;
    for (const [entry, { default: target }] of Object.entries(exports)) {
      if (entry === '.' || target === undefined) continue;
      const file = entry.slice('./'.length).replace(/(\.js)?$/, '.js');
      assert.ok(existsSync(folder + file), `${file} is missing beside package.json`);
      assert.match(readFileSync(folder + file, 'utf8'), new RegExp(`^export \\* from '${target}';$`, 'm'));
      assert.ok(files.includes(file), `package.json: files has no ${file}`);
    }
  });
}
