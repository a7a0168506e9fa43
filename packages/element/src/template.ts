import { html, nothing, type TemplateResult } from 'lit';
import { visitorMessage, type ElementError } from './errors.js';
import { languageOf, word, type SpokenStrings } from './words.js';

/** Everything that the shadow tree shows. */
export interface TemplateModel {
  /** Text alternative; empty for a decorative scene, null where the page gives none. */
  readonly label: string | null;
  /** People may move the camera. */
  readonly canMove: boolean;
  readonly navigation: 'orbit' | 'fly' | 'walk';
  /** Help for the keys of walking, once a floor is looked for. */
  readonly walkKeys: string | undefined;
  readonly poster: string | null;
  readonly posterLoading: 'lazy' | 'eager';
  readonly showPoster: boolean;
  /** The poster waits for a person: what dismisses it. */
  readonly onReveal: (() => void) | null;
  readonly isLoading: boolean;
  /** Share of the loading that is done, 0..1; null while it is not known. */
  readonly progress: number | null;
  readonly error: ElementError | null;
  /** There is a poster, of the attribute or of the page's own. */
  readonly hasPoster: boolean;
  /** How people learn that they can move the scene. */
  readonly prompt: 'none' | 'basic' | 'wiggle';
  /** Brings the camera back; null where no button is offered for it. */
  readonly onReset: (() => void) | null;
  /** Words of the page in place of the English ones. */
  readonly strings: SpokenStrings;
  /** What screen readers are told: of an error, else of the camera. */
  readonly spoken: string;
  /** What people see who may move the camera, once its code is there. */
  readonly handsView: ((model: TemplateModel) => TemplateResult) | undefined;
  /** The button for all that moves by itself; undefined where nothing does. */
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

/** The picture. One canvas for life, whatever the attributes: a context cannot move from one to another. */
function view({ label, canMove: controls, onReveal, strings }: TemplateModel): TemplateResult {
  const role = controls ? 'application' : label === '' ? 'presentation' : 'img';
  // Behind a poster that waits for a person there is nothing to see or to do yet.
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

/** A box for each name, in their order; where it lies is up to the controller of the hotspots. Under a poster nobody reaches them. */
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
 * The poster is scenery of the same scene, so it needs no text of its own. One that waits for a person is a button around the image, the page's
 * own included, with a sign that there is something to start.
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
 * What went wrong: a sentence for visitors, and the details for those who made the page. Screen readers announce only what comes into a
 * region that was there before, so the sentence is told in that, too. Where there is no WebGPU visitors can mend nothing: they get the poster alone, or the
 * sentence at the edge.
 */
function message({ hasPoster, strings }: TemplateModel, error: ElementError): TemplateResult {
  const lang = languageOf(strings) ?? nothing;
  const text = html`<p lang=${lang}>${visitorMessage(error, strings)}</p>`;
  if (error.code === 'unsupported')
    return html`<div class="layer message">
      <slot name="fallback">${hasPoster ? nothing : html`<div part="fallback">${text}</div>`}</slot>
    </div>`;
  // The details are for the person who made the page, and always English.
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
