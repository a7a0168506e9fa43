/** Addresses within the site, relative to the page that names them: the site may lie in any folder of any host. */
import { posix } from 'node:path';

/** @param from {string} the page's address, with a slash in front and, for a folder, behind. @param to {string} likewise. */
export function relativeAddress(from, to) {
  const folder = from.endsWith('/') ? from : posix.dirname(from);
  const path = posix.relative(folder, to) || '.';
  return to.endsWith('/') ? `${path}/` : path;
}
