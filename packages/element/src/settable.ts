import type { LitElement } from 'lit';
import type { MediaProperties } from './media.js';
import type { SplatProperties } from './properties.js';

/**
 * The properties that a page may set, for the typings of frameworks: those of the attributes, and of time `currentTime` and `playbackRate`.
 * Methods and what can only be read (`error`, `duration`, ...) are left out: a framework that sets them throws.
 */
export type SettableProperties = Partial<
  Pick<SplatProperties, Exclude<keyof SplatProperties, keyof LitElement>> &
    Pick<MediaProperties, 'currentTime' | 'playbackRate'>
>;
