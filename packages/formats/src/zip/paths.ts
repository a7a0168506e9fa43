import { quote } from '../bytes.js';

/** Matches the paths of metadata files that macOS adds for other files. */
const NO_CONTENT = /(^|\/)(__MACOSX\/|\._)/;

/** Returns the paths without metadata files of macOS. */
export const relevant = (paths: readonly string[]): string[] => paths.filter((path) => !NO_CONTENT.test(path));

/** Returns the paths of files with a name, least nested first. */
export const namedLike = (name: string, paths: readonly string[]): string[] =>
  paths.filter((path) => path.split('/').pop() === name).sort((a, b) => depthOf(a) - depthOf(b));

/** Returns the least nested paths. */
export function shallowest(paths: readonly string[]): string[] {
  const depth = paths.reduce((min, path) => Math.min(min, depthOf(path)), Infinity);
  return paths.filter((path) => depthOf(path) === depth);
}

const depthOf = (path: string): number => path.split('/').length;

/** Formats the first 4 paths for error messages, and the number of further ones. */
export function listed(paths: readonly string[]): string {
  const shown = paths.slice(0, 4).map((path) => quote(path, 40));
  return paths.length === 0 ? 'no files' : shown.join(', ') + (paths.length > 4 ? ` and ${paths.length - 4} more` : '');
}
