/** Parts of a label that have their own use for pointers and for the wheel. */

/** Panels that a label has opened: they lie over the page, not in the scene. An unknown selector within `:is` matches nothing. */
const panel = ':is(:popover-open, :modal, :fullscreen, dialog[open])';
/** What a drag selects or moves. */
const dragged = `${panel}, input, select, textarea, video, audio, [contenteditable], [draggable=true]`;

export const labelParts = {
  panel,
  dragged,
  /** What has something to copy, to save or to follow. */
  withMenu: `${dragged}, a[href], img`,
};

/** Whether an event comes from such a node below the one that listens, also from a shadow tree of the page. */
export function isWithin(event: Event, selector: string): boolean {
  const path = event.composedPath();
  const nodes = path.slice(0, path.indexOf(event.currentTarget!));
  return nodes.some((node) => (node as Partial<Element>).matches?.(selector));
}

/** Whether there is anything to scroll: a box between a node and another, or, up to the page, the page itself or that of a frame around it. */
export function scrollsAround(node: Element | null, end: Element | null = null): boolean {
  if (node === end) return end === null && self !== top;
  const { scrollHeight, clientHeight, ownerDocument, parentElement } = node!;
  const isBox = node === ownerDocument.scrollingElement || /auto|scroll/.test(getComputedStyle(node!).overflowY);
  return (scrollHeight > clientHeight && isBox) || scrollsAround(parentElement ?? hostOf(node!), end);
}

const hostOf = (node: Element): Element | null => (node.getRootNode() as Partial<ShadowRoot>).host ?? null;
