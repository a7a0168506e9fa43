import type { CSSResult } from 'lit';

/** Gives a shadow tree a style sheet of its own document: those of other documents are refused there. A document without a window shows nothing, and gets none. */
export function adoptStyles(root: ShadowRoot, { cssText }: CSSResult): void {
  const { defaultView } = root.ownerDocument;
  if (defaultView === null) return;
  const sheet = new (defaultView as Window & typeof globalThis).CSSStyleSheet();
  sheet.replaceSync(cssText);
  root.adoptedStyleSheets = [sheet];
}
