/** Attributes of the element that only late-loaded code for models reads. */
import { Lazy } from '@gaussian-splat/core';
import type { DynamicRequest } from './dynamic-model.js';

interface ModelElement extends HTMLElement {
  readonly compare?: string | null;
  readonly controlsPanel?: boolean;
}

/** Value of the attribute `gpu-check`; child elements have no property for it. Any value but "off" is the default. */
export const compareOf = ({
  element,
  loader,
}: Pick<DynamicRequest, 'element' | 'loader'>): false | DynamicRequest['loader']['spawn'] =>
  ((element as ModelElement).compare ?? element.getAttribute('compare'))?.trim() === 'off' ? false : loader.spawn;

const ownerOf = (element: HTMLElement): ModelElement | null =>
  'controlsPanel' in element ? (element as ModelElement) : element.parentElement;

const panel = new Lazy('the code of the panel of controls', () => import('./controls-panel.js'));

const offered = new WeakSet<HTMLElement>();

/** Creates the panel of controls of an element, or of a child's parent, whenever its attribute is set. */
export function offerPanel(element: HTMLElement): void {
  if (offered.has(element)) return;
  offered.add(element);
  // A child may be moved to another element, and has none after its removal.
  let last: ModelElement | null = null;
  const show = async (): Promise<void> => {
    const owner = ownerOf(element);
    const hosts = new Set([last, owner]);
    last = owner;
    for (const host of hosts) {
      if (!host?.controlsPanel) continue;
      const { ControlsPanel } = await panel.get();
      ControlsPanel.show(host as Parameters<typeof ControlsPanel.show>[0]);
    }
  };
  const showOrReport = (): void => void show().catch((error: unknown) => console.warn('<gaussian-splat>:', error));
  element.addEventListener('inputs-change', showOrReport);
  const owner = ownerOf(element);
  if (owner) new MutationObserver(showOrReport).observe(owner, { attributeFilter: ['controls-panel'] });
}
