/** Selectors of the parts of a label that use pointers or the wheel themselves. */

/**
 * Open panels of a label, which lie over the page and not in the scene. A selector within `:is` that the browser does
 * not know matches nothing.
 */
const panel = ':is(:popover-open, :modal, :fullscreen, dialog[open])';
/** Elements that use a drag to select or move content. */
const dragged = `${panel}, input, select, textarea, video, audio, [contenteditable], [draggable=true]`;

export const labelParts = {
  panel,
  dragged,
  /** Elements with content to copy, save or follow. */
  withMenu: `${dragged}, a[href], img`,
};

/**
 * Returns whether an event comes from a node that matches the selector, or from inside one. Only nodes below the
 * listener count, also those in a shadow tree of the page.
 */
export function isWithin(event: Event, selector: string): boolean {
  const path = event.composedPath();
  const nodes = path.slice(0, path.indexOf(event.currentTarget!));
  return nodes.some((node) => (node as Partial<Element>).matches?.(selector));
}

/**
 * Returns whether the wheel can scroll something: a box between `node` and its ancestor `end`, exclusive. If `end` is
 * null, the page itself and a page around an `<iframe>` count, too. Boxes in the shadow trees of components count if they
 * contain the node through a slot.
 */
export function scrollsAround(node: Element | null, end: Element | null = null): boolean {
  if (node === end) return end === null && self !== top;
  const { scrollHeight, clientHeight, ownerDocument, parentElement, assignedSlot } = node!;
  const isBox = node === ownerDocument.scrollingElement || /auto|scroll/.test(getComputedStyle(node!).overflowY);
  return (scrollHeight > clientHeight && isBox) || scrollsAround(assignedSlot ?? parentElement ?? hostOf(node!), end);
}

const hostOf = (node: Element): Element | null => (node.getRootNode() as Partial<ShadowRoot>).host ?? null;
