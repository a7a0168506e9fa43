import { html, nothing, type TemplateResult } from 'lit';
import { visitorMessage, type ElementError } from './errors.js';
import { languageOf, word, type A11yStrings } from './words.js';

/** Everything that the shadow tree shows. */
export interface TemplateModel {
  /** Text alternative; empty for a decorative scene, null if the page gives none. */
  readonly label: string | null;
  /** Visitors may move the camera. */
  readonly canMove: boolean;
  readonly navigation: 'orbit' | 'fly' | 'walk';
  /** Help for the keys of walking, once a floor is requested. */
  readonly walkKeys: string | undefined;
  readonly poster: string | null;
  readonly posterLoading: 'lazy' | 'eager';
  readonly showPoster: boolean;
  /** Dismisses a poster that waits for the visitor. */
  readonly onReveal: (() => void) | null;
  readonly isLoading: boolean;
  /** Loading progress, 0..1; null while unknown. */
  readonly progress: number | null;
  readonly error: ElementError | null;
  /** There is a poster, from the attribute or the slot. */
  readonly hasPoster: boolean;
  /** Hint that the scene can be moved. */
  readonly prompt: 'none' | 'basic' | 'wiggle';
  /** Resets the camera; null if no button is offered. */
  readonly onReset: (() => void) | null;
  /** Words of the page in place of the English ones. */
  readonly strings: A11yStrings;
  /** Text for screen readers: the error, or else the camera. */
  readonly spoken: string;
  /** Hints for visitors who may move the camera, after its code has loaded. */
  readonly handsView: ((model: TemplateModel) => TemplateResult) | undefined;
  /** The button that pauses all automatic motion; undefined without any. */
  readonly motionView: TemplateResult | undefined;
  /** Names of the slots of the hotspots. */
  readonly hotspots: readonly string[];
}

const PLAY_SIGN = 'M8 5v14l11-7z';

/** The element's shadow tree. */
export function template(model: TemplateModel): TemplateResult {
  return html`
    ${view(model)} ${hotspots(model)} ${model.handsView?.(model)} ${model.motionView} ${poster(model)}
    ${model.isLoading ? progressBar(model) : nothing} ${model.error ? message(model, model.error) : nothing}
    <div class="for-screen-readers" role="status" lang=${languageOf(model.strings) ?? nothing}>${model.spoken}</div>
  `;
}

/** The image. The canvas stays the same for all attributes, because a context cannot move between canvases. */
function view({ label, canMove: controls, onReveal, strings }: TemplateModel): TemplateResult {
  const role = controls ? 'application' : label === '' ? 'presentation' : 'img';
  // The scene behind a poster that waits for the visitor is neither visible nor interactive.
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

/** A box per name, in order; the hotspot controller positions it. Boxes under a poster are unreachable. */
function hotspots({ hotspots, showPoster }: TemplateModel): TemplateResult {
  return html`<div id="hotspots" class="layer ${showPoster ? 'gone' : ''}">
    ${hotspots.map(
      (name) =>
        html`<div class="hotspot hidden">
          <div><slot name=${name}></slot></div>
        </div>`,
    )}
  </div>`;
}

/**
 * The poster depicts the same scene, so it needs no text of its own. One that waits for the visitor is a button around
 * the image, including a slotted one, with a play symbol.
 */
function poster(model: TemplateModel): TemplateResult {
  const { poster, posterLoading, showPoster, onReveal } = model;
  const image = poster
    ? html`<img part="poster" alt="" loading=${posterLoading} decoding="async" src=${poster} />`
    : nothing;
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
    <span part="poster-cue">
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
 * The error: a sentence for visitors, and details for the page's author. Screen readers announce only changes of a
 * region that already exists, so the sentence is repeated there. Without WebGPU the visitor can do nothing, so only the
 * poster is shown, or the sentence at the edge.
 */
function message({ hasPoster, strings }: TemplateModel, error: ElementError): TemplateResult {
  const lang = languageOf(strings) ?? nothing;
  const text = html`<p lang=${lang}>${visitorMessage(error, strings)}</p>`;
  if (error.code === 'unsupported')
    return html`<div class="layer message">
      <slot name="fallback">${hasPoster ? nothing : html`<div part="fallback">${text}</div>`}</slot>
    </div>`;
  // The details are for the page's author, and always in English.
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
