import { GaussianSplatError } from './errors.js';

/**
 * Address of a file that another file names. On the same server, a file without its own query gets that of the other,
 * because signed addresses need it. Other servers never receive the query.
 *
 * @param path Relative to the other file, or absolute.
 * @param parent Absolute address of the other file.
 */
export function partUrl(path: string, parent: string | URL): URL {
  const url = new URL(path, parent);
  const { protocol, host, search } = new URL(parent);
  if (url.search === '' && url.host === host && url.protocol === protocol) url.search = search;
  return url;
}

/** A file to fetch, and its cookies policy. */
export interface PartRequest {
  /** Absolute URL. */
  readonly url: string;
  readonly credentials: 'omit' | 'same-origin' | 'include';
}

/**
 * Request for a file that a manifest names: on the manifest's own server with its credentials, on servers that the page
 * allows without cookies, and on no others, because the author of a manifest must not choose the servers that visitors'
 * browsers contact.
 *
 * @param path Relative to the manifest, or absolute.
 * @param manifest Its own request.
 * @param origins Other allowed servers, such as `https://cdn.example`.
 * @throws GaussianSplatError `decode/unsupported` for other servers, and for relative paths in a manifest without a
 * base address (`blob:`, `data:`).
 */
export function fileRequest(path: string, manifest: PartRequest, origins: readonly string[] = []): PartRequest {
  const { url: parent, credentials } = manifest;
  const url = URL.canParse(path, parent) ? partUrl(path, parent) : undefined;
  if (url && serverOf(url) === serverOf(new URL(parent))) return { url: url.href, credentials };
  if (url && origins.includes(url.origin)) return { url: url.href, credentials: 'omit' };
  throw new GaussianSplatError('decode/unsupported', {
    where: parent.slice(0, 200),
    expected: 'files beside it, or on servers that the page allows',
    found: JSON.stringify(path.slice(0, 80)),
    remedy: 'serve the manifest beside its files, or name their server in GaussianSplatElement.sceneLimits.origins',
  });
}

/** Origins; local files and data URLs, which have none, count as separate servers. */
const serverOf = ({ origin, protocol, host }: URL): string => (origin === 'null' ? protocol + host : origin);
