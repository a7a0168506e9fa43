import { html, nothing, type TemplateResult } from 'lit';
import { visitorMessage, type ElementError } from './errors.js';
import { posterImage } from './poster-image.js';
import { languageOf, word, type A11yStrings } from './strings.js';

/** Data that the template of the shadow tree renders. */
export interface TemplateModel {
  /** Text alternative; an empty string for a decorative scene, null if the page sets none. */
  readonly label: string | null;
  /** Whether visitors may move the camera. */
  readonly canMove: boolean;
  readonly poster: string | null;
  readonly posterLoading: 'lazy' | 'eager';
  readonly showPoster: boolean;
  /** Dismisses a poster that waits for the visitor; null without such a poster. */
  readonly onReveal: (() => void) | null;
  readonly isLoading: boolean;
  /** Loading progress, 0..1; null while unknown. */
  readonly progress: number | null;
  readonly error: ElementError | null;
  /** Whether the page has a poster, in the attribute or the slot. */
  readonly hasPoster: boolean;
  /** Texts of the page that replace English texts. */
  readonly strings: A11yStrings;
  /** Text that screen readers announce when it changes: the error, or else the view of the camera. */
  readonly spoken: string;
  /** Names of the slots over the frame. */
  readonly slots: readonly string[];
}

const PLAY_SIGN = 'M8 5v14l11-7z';

/** Returns the content of the element's shadow tree. @param parts Those of the features. */
export function template(model: TemplateModel, parts: readonly unknown[]): TemplateResult {
  return html`
    ${view(model)} ${slots(model)} ${parts} ${poster(model)} ${model.isLoading ? progressBar(model) : nothing}
    ${model.error ? message(model, model.error) : nothing}
    <div class="for-screen-readers" role="status" lang=${languageOf(model.strings) ?? nothing}>${model.spoken}</div>
  `;
}

/**
 * Template of the canvas. The canvas element never changes, because a rendering context cannot be moved to another one.
 */
function view({ label, canMove: controls, onReveal, strings }: TemplateModel): TemplateResult {
  const role = controls ? 'application' : label === '' ? 'presentation' : 'img';
  // While a poster waits for the visitor, the scene behind it is neither visible nor interactive.
  const isWaiting = onReveal !== null;
  return html`
    <div
      id="view"
      class="view ${controls ? 'interactive' : ''} ${isWaiting ? 'covered' : ''}"
      role=${role}
      aria-label=${role === 'presentation' ? nothing : label || word(strings, 'scene')}
      lang=${(label ? undefined : languageOf(strings)) ?? nothing}
      aria-roledescription=${controls ? word(strings, 'role') : nothing}
      aria-describedby=${controls ? 'keys' : nothing}
      tabindex=${controls && !isWaiting ? '0' : nothing}
    >
      <canvas part="canvas"></canvas>
    </div>
  `;
}

/**
 * Template of the slots over the frame: one box for each, which a feature positions. Not visible while a poster is
 * shown.
 */
function slots({ slots, showPoster }: TemplateModel): TemplateResult {
  return html`<div id="hotspots" class="layer ${showPoster ? 'gone' : ''}">
    ${slots.map(
      (name) =>
        html`<div class="hotspot hidden">
          <div><slot name=${name}></slot></div>
        </div>`,
    )}
  </div>`;
}

/**
 * Template of the poster. If it waits for the visitor, a button with a play symbol encloses the image or the slotted
 * content.
 */
function poster(model: TemplateModel): TemplateResult {
  const { poster, posterLoading, showPoster, onReveal } = model;
  const image = poster ? posterImage(poster, posterLoading) : nothing;
  const content = html`<slot name="poster">${image}</slot>`;
  return html`<div class="layer poster ${showPoster ? '' : 'gone'}">
    ${onReveal ? revealButton(model, onReveal, content) : content}
  </div>`;
}

function revealButton(
  { label, strings }: TemplateModel,
  onReveal: () => void,
  content: TemplateResult,
): TemplateResult {
  const text = word(strings, 'show').replace('…', label || word(strings, 'scene'));
  const lang = (label ? undefined : languageOf(strings)) ?? nothing;
  return html`<button type="button" part="poster-button" aria-label=${text} lang=${lang} @click=${onReveal}>
    ${content}
    <span part="poster-icon">
      <svg viewBox="0 0 24 24" width="44" height="44" aria-hidden="true" fill="currentColor">
        <path d=${PLAY_SIGN} />
      </svg>
    </span>
  </button>`;
}

function progressBar({ progress, strings }: TemplateModel): TemplateResult {
  return html`<div class="layer progress">
    <slot name="progress-bar">
      <div
        part="progress-track"
        role="progressbar"
        lang=${languageOf(strings) ?? nothing}
        aria-label=${word(strings, 'loading')}
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
 * Template of the error: a sentence for visitors, and details for the page's author. `template` repeats the sentence in
 * its status region, because screen readers announce only changes of existing regions. Without WebGPU, only the poster
 * is shown, or the sentence at the bottom if there is none.
 */
function message({ hasPoster, strings }: TemplateModel, error: ElementError): TemplateResult {
  const lang = languageOf(strings) ?? nothing;
  const text = html`<p lang=${lang}>${visitorMessage(error, strings)}</p>`;
  if (error.code === 'unsupported')
    return html`<div class="layer message">
      <slot name="fallback">${hasPoster ? nothing : html`<div part="fallback">${text}</div>`}</slot>
    </div>`;
  // The details are always in English, because they are for the author of the page.
  return html`<div class="layer message">
    <slot name="error"
      ><div part="error">
        ${text}
        <details>
          <summary lang=${lang}>${word(strings, 'details')}</summary>
          <span lang="en">${error.message}</span>
        </details>
      </div></slot
    >
  </div>`;
}
