/** The main entries of packages export what applications use, and no more: the rest has subpaths. */
import assert from 'node:assert/strict';
import { test } from 'node:test';
import { fileURLToPath } from 'node:url';
import ts from 'typescript';

const MAX_NAMES = { core: 60, renderer: 70, economise: 60 };

for (const [name, most] of Object.entries(MAX_NAMES)) {
  test(`@gaussian-splat/${name} exports at most ${most} names, values and types together`, () => {
    const entry = fileURLToPath(new URL(`../../packages/${name}/dist/index.d.ts`, import.meta.url));
    const module = ts.ModuleKind.NodeNext;
    const options = { module, moduleResolution: ts.ModuleResolutionKind.NodeNext, noEmit: true, types: [] };
    const program = ts.createProgram([entry], options);
    const symbol = program.getTypeChecker().getSymbolAtLocation(program.getSourceFile(entry)!);
    const names = program
      .getTypeChecker()
      .getExportsOfModule(symbol!)
      .map((exported) => exported.name);
    console.log(`${name}: ${names.length} names`);
    assert.ok(names.length > 20 && names.length <= most, names.sort().join(' '));
  });
}
