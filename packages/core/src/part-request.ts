import { GaussianSplatError } from './errors.js';

/**
 * Address of a file that another file names. One on the same server without a query of its own gets that of the other: where addresses are signed, it is what lets one in. No other
 * server gets to know it.
 *
 * @param path relative to the other file, or absolute
 * @param parent absolute address of the other file
 */
export function partUrl(path: string, parent: string | URL): URL {
  const url = new URL(path, parent);
  const { protocol, host, search } = new URL(parent);
  if (url.search === '' && url.host === host && url.protocol === protocol) url.search = search;
  return url;
}

/** A file to be fetched, and whether cookies go along. */
export interface PartRequest {
  /** Absolute URL. */
  readonly url: string;
  readonly credentials: 'omit' | 'same-origin' | 'include';
}

/**
 * How a file is asked for that a manifest names: on the manifest's own server as the manifest was, on those that the page allows without cookies, and nowhere else: who writes a
 * manifest must not choose the servers that visitors' browsers ask.
 *
 * @param path relative to the manifest, or absolute
 * @param manifest as it was asked for itself
 * @param origins of other servers that are allowed, such as `https://cdn.example`
 * @throws GaussianSplatError `decode/unsupported` for other servers, and for relative paths in a manifest that has no place (`blob:`, `data:`)
 */
export function partRequest(path: string, manifest: PartRequest, origins: readonly string[] = []): PartRequest {
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

/** Origins; files on a disk and data, which have none, are on servers of their own. */
const serverOf = ({ origin, protocol, host }: URL): string => (origin === 'null' ? protocol + host : origin);
