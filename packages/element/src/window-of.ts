/** The window that a node is in: that of its document, which may be an `<iframe>`'s or a popup's. Where that has none any more, the page's own. */
export const windowOf = ({ ownerDocument }: Node): Window & typeof globalThis =>
  (ownerDocument?.defaultView as (Window & typeof globalThis) | null | undefined) ?? window;
