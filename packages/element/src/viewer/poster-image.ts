import { html, type TemplateResult } from 'lit';

/** Hides the symbol that browsers show for a broken image. */
const settle = ({ type, target }: Event): unknown =>
  ((target as HTMLElement).style.visibility = type === 'error' ? 'hidden' : '');

/** Template of the image of the attribute `poster`. It has no text alternative, because it shows the same scene. */
export const posterImage = (src: string, loading: 'lazy' | 'eager'): TemplateResult =>
  html`<img part="poster" alt="" loading=${loading} decoding="async" src=${src} @load=${settle} @error=${settle} />`;
