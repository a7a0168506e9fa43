import { GaussianSplatError } from './errors.js';

/**
 * Returns the address of a file that another file names. On the same server, an address without a query gets the query
 * of the other file, because signed addresses need it. Other servers never receive the query.
 *
 * @param path Path relative to the other file, or an absolute address.
 * @param parent Absolute address of the other file.
 */
export function partUrl(path: string, parent: string | URL): URL {
  const url = new URL(path, parent);
  const { protocol, host, search } = new URL(parent);
  if (url.search === '' && url.host === host && url.protocol === protocol) url.search = search;
  return url;
}

/** A file to fetch. `credentials` is that of `RequestInit`. */
export interface PartRequest {
  /** Absolute URL. */
  readonly url: string;
  readonly credentials: 'omit' | 'same-origin' | 'include';
}

/**
 * Returns the request for a file that a manifest names. A file on the manifest's own server is requested with the
 * manifest's credentials. A file on another server that the page allows is requested without cookies. Other servers are
 * refused, because the author of a manifest must not choose the servers that visitors' browsers contact.
 *
 * @param path Path relative to the manifest, or an absolute address.
 * @param manifest Request of the manifest.
 * @param origins Origins of other allowed servers, such as `https://cdn.example`.
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

/**
 * Returns the origin of an address. Addresses without an origin are grouped by scheme and host: all local files count
 * as one server, all data URLs as another.
 */
const serverOf = ({ origin, protocol, host }: URL): string => (origin === 'null' ? protocol + host : origin);
