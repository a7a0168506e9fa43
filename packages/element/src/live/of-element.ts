/** What only code that is loaded for models reads of their element. */
import type { LiveRequest } from './live-model.js';

interface ModelElement extends HTMLElement {
  readonly compare?: string | null;
  readonly controlsPanel?: boolean;
}

/** What the attribute `compare` asks for; elements within another have no property of it. Anything but "off" is what it is without the attribute. */
export const compareOf = ({
  element,
  loader,
}: Pick<LiveRequest, 'element' | 'loader'>): false | LiveRequest['loader']['spawn'] =>
  ((element as ModelElement).compare ?? element.getAttribute('compare'))?.trim() === 'off' ? false : loader.spawn;

const offered = new WeakSet<HTMLElement>();

/** From now on the element has a panel of controls whenever its attribute asks for one. */
export function offerPanel(element: HTMLElement): void {
  if (offered.has(element)) return;
  offered.add(element);
  const show = async (): Promise<void> => {
    if (!(element as ModelElement).controlsPanel) return;
    const { ControlsPanel } = await import('./controls-panel.js');
    ControlsPanel.show(element as Parameters<typeof ControlsPanel.show>[0]);
  };
  const showOrTell = (): void => void show().catch((error: unknown) => console.warn('<gaussian-splat>:', error));
  element.addEventListener('inputs-change', showOrTell);
  new MutationObserver(showOrTell).observe(element, { attributeFilter: ['controls-panel'] });
}
