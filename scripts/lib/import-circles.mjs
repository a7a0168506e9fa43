/** Circles of imports among the source files of a package, imports of types included. */
import { readdirSync, readFileSync } from 'node:fs';
import { dirname, join, relative } from 'node:path';

/** Tables of late-loaded parts: they import files that may import them back. */
const REGISTRIES = ['formats.ts', 'late-formats.ts'];
/** `from '…'` and `import('…')`, as formatted by Prettier. */
const STATIC = /\bfrom\s*'(\.{1,2}\/[^']+)'/g;
const SPECIFIER = /(?:\bfrom|\bimport\()\s*'(\.{1,2}\/[^']+)'/g;

/** The files that each file of a folder imports, by their paths relative to it. */
export function importsIn(folder) {
  const files = readdirSync(folder, { recursive: true }).filter((file) => /\.ts$/.test(file) && !/\.d\.ts$/.test(file));
  const known = new Set(files);
  return new Map(
    files.map((file) => {
      const text = readFileSync(join(folder, file), 'utf8');
      const imported = [...text.matchAll(REGISTRIES.includes(file) ? STATIC : SPECIFIER)].map(([, name]) =>
        relative(folder, join(folder, dirname(file), name.replace(/\.js$/, '.ts'))),
      );
      return [file, [...new Set(imported)].filter((name) => known.has(name))];
    }),
  );
}

/** Sets of several files that all import one another, directly or by way of others: Tarjan's strongly connected components. */
export function circlesOf(graph) {
  const index = new Map();
  const low = new Map();
  const stack = [];
  const circles = [];
  const visit = (file) => {
    index.set(file, index.size);
    low.set(file, index.get(file));
    stack.push(file);
    for (const next of graph.get(file)) {
      if (!index.has(next)) visit(next);
      if (stack.includes(next)) low.set(file, Math.min(low.get(file), low.get(next)));
    }
    if (low.get(file) !== index.get(file)) return;
    const circle = stack.splice(stack.indexOf(file));
    if (circle.length > 1) circles.push(circle.sort());
  };
  for (const file of graph.keys()) if (!index.has(file)) visit(file);
  return circles.sort((a, b) => b.length - a.length);
}
