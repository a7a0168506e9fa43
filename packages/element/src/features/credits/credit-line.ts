import type { Credits } from '@gaussian-splat/core';
import { css, html, nothing, type ReactiveController, type TemplateResult } from 'lit';
import type { Feature } from '../../viewer/features.js';
import { adoptStyles } from '../../viewer/styles.js';
import type { TemplateModel } from '../../viewer/template.js';
import type { Viewer } from '../../viewer/viewer.js';

const STYLES = css`
  .credits {
    position: absolute;
    inset-block: auto 0;
    inset-inline-end: 0;
    max-inline-size: 100%;
    pointer-events: none;
  }
  /* The buttons at the bottom keep their place. */
  :is(.buttons:not(:empty), button) ~ .credits,
  .credits:has(~ button) {
    inset-block: 0 auto;
  }
  [part='credits'] {
    padding: 1px 6px;
    box-sizing: border-box;
    font: var(--credits-font, 11px / 1.5 system-ui, sans-serif);
    text-align: end;
    overflow-wrap: anywhere;
    color: var(--credits-color, rgb(255 255 255));
    background: var(--credits-background, rgb(0 0 0 / 0.6));
  }
  [part='credits'] a,
  .credits ::slotted(*) {
    color: inherit;
    pointer-events: auto;
  }
`;

/** Shows the credits of all sources in a line over the frame, and reports them to the page. */
export class CreditLine implements ReactiveController, Feature {
  readonly #viewer: Viewer;
  #reported = '[]';

  constructor(viewer: Viewer) {
    this.#viewer = viewer;
    adoptStyles(viewer.element.shadowRoot!, STYLES);
    viewer.element.addController(this);
  }

  hostUpdated(): void {
    const credits = this.credits;
    const text = JSON.stringify(credits);
    if (text === this.#reported) return;
    this.#reported = text;
    this.#viewer.element.dispatchEvent(new CustomEvent('credits-change', { detail: { credits } }));
  }

  view({ showPoster }: TemplateModel): TemplateResult | undefined {
    const credits = this.credits;
    if (showPoster || credits.length === 0) return undefined;
    return html`<div class="credits">
      <slot name="credits"
        ><p part="credits">${credits.map((own, k) => html`${k > 0 ? ' | ' : nothing}${lineOf(own)}`)}</p></slot
      >
    </div>`;
  }

  /** Credits of all sources, each once. The attributes replace those of the element's own source. */
  get credits(): readonly Credits[] {
    const { attributes, sources } = this.#viewer;
    const distinct = new Map<string, Credits>();
    for (const entry of sources.entries) {
      const { attribution, license } = entry.member?.scene.credits ?? {};
      const isOwn = entry === sources.ownEntry;
      const own = {
        attribution: (isOwn ? attributes.attribution : null) ?? attribution,
        license: (isOwn ? attributes.license : null) ?? license,
      };
      if (own.attribution || own.license) distinct.set(JSON.stringify(own), own);
    }
    return [...distinct.values()];
  }
}

function lineOf({ attribution, license }: Credits): TemplateResult {
  // Texts of files have their own direction.
  const name = attribution ? html`<bdi>${attribution}</bdi>` : nothing;
  return html`${name}${attribution && license ? ', ' : nothing}${license ? licenseOf(license) : nothing}`;
}

/** Identifier of a license of Creative Commons. Sketchfab writes an address in parentheses after it, which is left out. */
const CREATIVE_COMMONS = /^(CC-(BY(?:-NC)?(?:-SA|-ND)?)-(\d\.\d)|CC0-1\.0)(?: \(https?:\/\/[^)\s]*\))?$/i;

/** Returns a license as a link to its deed, if it is one of Creative Commons. No other text of a file becomes a link. */
function licenseOf(license: string): TemplateResult {
  const found = CREATIVE_COMMONS.exec(license);
  if (!found) return html`<bdi>${license}</bdi>`;
  const [, name, terms, version] = found;
  const path = terms ? `licenses/${terms.toLowerCase()}/${version}/` : 'publicdomain/zero/1.0/';
  return html`<a href="https://creativecommons.org/${path}" rel="license noopener" target="_blank">${name}</a>`;
}
