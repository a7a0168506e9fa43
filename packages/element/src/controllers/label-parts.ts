/** Parts of a label with their own use of pointers and of the wheel. */

/**
 * Panels that a label has opened: they lie over the page, not in the scene. An unknown selector within `:is` matches
 * nothing.
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

/** Whether an event comes from a matching node below the listener, also from a shadow tree of the page. */
export function isWithin(event: Event, selector: string): boolean {
  const path = event.composedPath();
  const nodes = path.slice(0, path.indexOf(event.currentTarget!));
  return nodes.some((node) => (node as Partial<Element>).matches?.(selector));
}

/** Whether anything is scrollable: a box between a node and another, or the page itself or that of a frame around it. */
export function scrollsAround(node: Element | null, end: Element | null = null): boolean {
  if (node === end) return end === null && self !== top;
  const { scrollHeight, clientHeight, ownerDocument, parentElement } = node!;
  const isBox = node === ownerDocument.scrollingElement || /auto|scroll/.test(getComputedStyle(node!).overflowY);
  return (scrollHeight > clientHeight && isBox) || scrollsAround(parentElement ?? hostOf(node!), end);
}

const hostOf = (node: Element): Element | null => (node.getRootNode() as Partial<ShadowRoot>).host ?? null;
