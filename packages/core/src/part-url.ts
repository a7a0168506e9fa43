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
