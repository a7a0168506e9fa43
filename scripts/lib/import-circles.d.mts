/** Relative paths of source files, and of those that each imports. */
export type ImportGraph = ReadonlyMap<string, readonly string[]>;
export function importsIn(folder: string): ImportGraph;
export function circlesOf(graph: ImportGraph): string[][];
