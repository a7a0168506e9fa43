import { html, nothing, type TemplateResult } from 'lit';
import { visitorMessage, type ElementError } from './errors.js';

/** Everything that the shadow tree shows. */
export interface TemplateModel {
  /** Text alternative; empty for a decorative scene. */
  readonly label: string;
  readonly controls: boolean;
  readonly poster: string | null;
  readonly posterLoading: 'lazy' | 'eager';
  readonly showPoster: boolean;
  readonly isLoading: boolean;
  /** Share of the bytes that have arrived, 0..1; null while their number is not known. */
  readonly progress: number | null;
  readonly error: ElementError | null;
}

/** Used where a page gives no text alternative. */
export const DEFAULT_LABEL = '3D scene';

const KEYS_HELP =
  'Arrow keys turn the view, Page Up and Page Down or plus and minus change the distance, ' +
  'Shift with the arrow keys moves it sideways, Home brings it back.';

/** The element's shadow tree. */
export function template(model: TemplateModel): TemplateResult {
  return html`
    ${view(model)} ${poster(model)} ${model.isLoading ? progressBar(model.progress) : nothing}
    ${model.error ? message(model.error) : nothing}
  `;
}

/** The picture. One canvas for life, whatever the attributes: a context cannot move from one to another. */
function view({ label, controls }: TemplateModel): TemplateResult {
  const role = controls ? 'application' : label === '' ? 'presentation' : 'img';
  return html`
    <div
      id="view"
      class=${controls ? 'view interactive' : 'view'}
      role=${role}
      aria-label=${role === 'presentation' ? nothing : label || DEFAULT_LABEL}
      aria-roledescription=${controls ? '3D scene viewer' : nothing}
      aria-describedby=${controls ? 'keys' : nothing}
      tabindex=${controls ? '0' : nothing}
    >
      <canvas part="canvas"></canvas>
    </div>
    ${controls ? html`<span id="keys" class="for-screen-readers" aria-hidden="true">${KEYS_HELP}</span>` : nothing}
  `;
}

/** The poster is scenery of the same scene, so it needs no text of its own. */
function poster({ poster, posterLoading, showPoster }: TemplateModel): TemplateResult {
  const image = html`<img part="poster" alt="" loading=${posterLoading} decoding="async" src=${poster ?? ''} />`;
  return html`<div class=${showPoster ? 'layer poster' : 'layer poster gone'}>
    <slot name="poster">${poster ? image : nothing}</slot>
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

/** What went wrong: a sentence for visitors, and the details for those who made the page. */
function message(error: ElementError): TemplateResult {
  const text = html`<p>${visitorMessage(error)}</p>
    <details>
      <summary>Details</summary>
      ${error.message}
    </details>`;
  return html`<div class="layer message" role="status">
    ${
      error.code === 'unsupported'
        ? html`<slot name="fallback"><div part="fallback">${text}</div></slot>`
        : html`<slot name="error"><div part="error">${text}</div></slot>`
    }
  </div>`;
}
