/** Reads attributes of the element that only concern models. Late-loaded code for models imports this module. */
import { Lazy } from '@gaussian-splat/core';
import type { DynamicRequest } from './dynamic-model.js';

interface ModelElement extends HTMLElement {
  readonly gpuCheck?: string | null;
  readonly controlsPanel?: boolean;
}

/**
 * Returns the function that starts workers for the check of the GPU's results, or false if the attribute `gpu-check` is
 * "off". Child elements have no property for this attribute.
 */
export const gpuCheckOf = ({
  element,
  loader,
}: Pick<DynamicRequest, 'element' | 'loader'>): false | DynamicRequest['loader']['spawn'] =>
  ((element as ModelElement).gpuCheck ?? element.getAttribute('gpu-check'))?.trim() === 'off' ? false : loader.spawn;

const ownerOf = (element: HTMLElement): ModelElement | null =>
  'controlsPanel' in element ? (element as ModelElement) : element.parentElement;

const panel = new Lazy('the code of the panel of controls', () => import('./controls-panel.js'));

const offered = new WeakSet<HTMLElement>();

/**
 * Shows the panel of controls whenever the attribute `controls-panel` of an element is set, or that of the parent of a
 * child element.
 */
export function offerPanel(element: HTMLElement): void {
  if (offered.has(element)) return;
  offered.add(element);
  // The owner may change: a child may be moved to another element, and has no owner after its removal.
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
