/**
 * Returns the text that identifies the kind of a file: the path of an address, or the name that a page has appended to
 * an object URL.
 */
export function nameIn(url: string): string {
  if (!URL.canParse(url)) return url;
  const { pathname, protocol, hash } = new URL(url);
  return protocol === 'blob:' ? hash : pathname;
}
