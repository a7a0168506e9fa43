import { html, nothing, svg, type TemplateResult } from 'lit';
import { visitorMessage, type ElementError } from './errors.js';

/** Everything that the shadow tree shows. */
export interface TemplateModel {
  /** Text alternative; empty for a decorative scene. */
  readonly label: string;
  readonly controls: boolean;
  readonly navigation: 'orbit' | 'fly';
  readonly poster: string | null;
  readonly posterLoading: 'lazy' | 'eager';
  readonly showPoster: boolean;
  /** The poster waits for a person: what dismisses it. */
  readonly onReveal: (() => void) | null;
  readonly isLoading: boolean;
  /** Share of the bytes that have arrived, 0..1; null while their number is not known. */
  readonly progress: number | null;
  readonly error: ElementError | null;
  /** How people learn that they can move the scene. */
  readonly prompt: 'none' | 'basic' | 'wiggle';
  /** What screen readers are told of the prompt, where the page has its own words. */
  readonly promptText: string | undefined;
  /** What screen readers are told: of an error, else of the camera. */
  readonly spoken: string;
  /** Slots of the hotspots. */
  readonly hotspots: readonly string[];
}

/** Used where a page gives no text alternative. */
export const DEFAULT_LABEL = '3D scene';

const KEYS_HELP = {
  orbit:
    'Arrow keys turn the view, Page Up and Page Down or plus and minus change the distance, ' +
    'Shift with the arrow keys moves it sideways, Home brings it back.',
  fly:
    'Arrow keys look around, W and S fly forward and back, A and D to the sides, E and Q up and down, with Shift faster, ' +
    'Home brings the view back.',
};

/** The element's shadow tree. */
export function template(model: TemplateModel): TemplateResult {
  return html`
    ${view(model)} ${hotspots(model)} ${prompt(model)} ${poster(model)}
    ${model.isLoading ? progressBar(model.progress) : nothing} ${model.error ? message(model.error) : nothing}
    <div class="for-screen-readers" role="status">${model.spoken}</div>
  `;
}

/** The picture. One canvas for life, whatever the attributes: a context cannot move from one to another. */
function view({ label, controls, navigation, onReveal }: TemplateModel): TemplateResult {
  const role = controls ? 'application' : label === '' ? 'presentation' : 'img';
  // Behind a poster that waits for a person there is nothing to see or to do yet.
  const isWaiting = onReveal !== null;
  return html`
    <div
      id="view"
      class="view ${controls ? 'interactive' : ''} ${isWaiting ? 'covered' : ''}"
      role=${role}
      aria-label=${role === 'presentation' ? nothing : label || DEFAULT_LABEL}
      aria-roledescription=${controls ? '3D scene viewer' : nothing}
      aria-describedby=${controls ? 'keys' : nothing}
      tabindex=${controls && !isWaiting ? '0' : nothing}
    >
      <canvas part="canvas"></canvas>
    </div>
    ${controls ? html`<span id="keys" class="for-screen-readers" hidden>${KEYS_HELP[navigation]}</span>` : nothing}
  `;
}

/** A box for each name, in their order; where it lies is up to the controller of the hotspots. Under a poster nobody reaches them. */
function hotspots({ hotspots, showPoster }: TemplateModel): TemplateResult {
  return html`<div id="hotspots" class="layer ${showPoster ? 'gone' : ''}">
    ${hotspots.map((name) => html`<div class="hotspot hidden"><slot name=${name}></slot></div>`)}
  </div>`;
}

/** A hand that drags. Only a picture: those who do not see it are told the keys when the scene has the focus. */
function prompt({ prompt, promptText }: TemplateModel): TemplateResult | typeof nothing {
  if (prompt === 'none') return nothing;
  const hand = svg`<path d="M9 11.24V7.5a2.5 2.5 0 0 1 5 0v3.74a4.5 4.5 0 1 0-5 0zm9.84 4.63-4.54-2.26a1 1 0 0 0-.54-.11H13v-6a1.5
    1.5 0 0 0-3 0v10.74l-3.43-.72a1 1 0 0 0-1 .33l-.57.62 4.94 4.94a1.5 1.5 0 0 0 1.06.44h6.79a1.5 1.5 0 0 0 1.48-1.29l.75-5.27a1.5
    1.5 0 0 0-.18-1.42z" />`;
  return html`<div class="layer prompt">
    <slot name="interaction-prompt">
      <div part="prompt" class=${prompt} role="img" aria-label=${promptText ?? 'Drag to look around'}>
        <svg viewBox="0 0 24 24" width="44" height="44" aria-hidden="true" fill="currentColor">${hand}</svg>
      </div>
    </slot>
  </div>`;
}

/** The poster is scenery of the same scene, so it needs no text of its own; one that waits for a person is a button. */
function poster({ poster, posterLoading, showPoster, onReveal, label }: TemplateModel): TemplateResult {
  const image = poster
    ? html`<img part="poster" alt="" loading=${posterLoading} decoding="async" src=${poster} />`
    : nothing;
  const button = html`<button
    type="button"
    part="poster-button"
    aria-label="Show ${label || DEFAULT_LABEL}"
    @click=${onReveal}
  >
    ${image}
  </button>`;
  return html`<div class="layer poster ${showPoster ? '' : 'gone'}">
    <slot name="poster">${onReveal ? button : image}</slot>
  </div>`;
}

function progressBar(progress: number | null): TemplateResult {
  return html`<div class="layer progress">
    <slot name="progress-bar">
      <div
        part="progress-track"
        role="progressbar"
        aria-label="Loading the 3D scene"
        aria-valuemin="0"
        aria-valuemax="100"
        aria-valuenow=${progress === null ? nothing : String(Math.round(100 * progress))}
      >
        <div part="progress-bar"></div>
      </div>
    </slot>
  </div>`;
}

/**
 * What went wrong: a sentence for visitors, and the details for those who made the page. Screen readers announce only what comes into a
 * region that was there before, so the sentence is told in that, too.
 */
function message(error: ElementError): TemplateResult {
  const text = html`<p>${visitorMessage(error)}</p>
    <details>
      <summary>Details</summary>
      ${error.message}
    </details>`;
  return html`<div class="layer message">
    ${
      error.code === 'unsupported'
        ? html`<slot name="fallback"><div part="fallback">${text}</div></slot>`
        : html`<slot name="error"><div part="error">${text}</div></slot>`
    }
  </div>`;
}
