/** Addresses within the site, relative to the page that names them: the site may lie in any folder of any host. */
import { existsSync, readdirSync } from 'node:fs';
import { join, posix } from 'node:path';
import { root } from '../../scripts/lib/run.mjs';

/** Folders of demo/ that are pages of the site, such as `examples/features`. */
export const pageFolders = readdirSync(join(root, 'demo'), { recursive: true })
  .filter((folder) => !/(^|[/\\])(dist|node_modules)\b/.test(folder))
  .filter((folder) => ['index.njk', 'index.html'].some((name) => existsSync(join(root, 'demo', folder, name))))
  .map((folder) => folder.replaceAll('\\', '/'));

/** @param from {string} the page's address, with a slash in front and, for a folder, behind. @param to {string} in the same form. */
export function relativeAddress(from, to) {
  const folder = from.endsWith('/') ? from : posix.dirname(from);
  const path = posix.relative(folder, to) || '.';
  return to.endsWith('/') ? `${path}/` : path;
}
