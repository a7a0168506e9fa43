import { quote } from '../bytes.js';

/** Metadata files that macOS adds, with the names of others. */
const NO_CONTENT = /(^|\/)(__MACOSX\/|\._)/;

/** Paths of files without such metadata. */
export const relevant = (paths: readonly string[]): string[] => paths.filter((path) => !NO_CONTENT.test(path));

/** Files of this name, least nested first. */
export const namedLike = (name: string, paths: readonly string[]): string[] =>
  paths.filter((path) => path.split('/').pop() === name).sort((a, b) => depthOf(a) - depthOf(b));

/** The least nested paths. */
export function shallowest(paths: readonly string[]): string[] {
  const depth = paths.reduce((min, path) => Math.min(min, depthOf(path)), Infinity);
  return paths.filter((path) => depthOf(path) === depth);
}

const depthOf = (path: string): number => path.split('/').length;

/** The first paths, for error messages. */
export function listed(paths: readonly string[]): string {
  const shown = paths.slice(0, 4).map((path) => quote(path, 40));
  return paths.length === 0 ? 'no files' : shown.join(', ') + (paths.length > 4 ? ` and ${paths.length - 4} more` : '');
}
