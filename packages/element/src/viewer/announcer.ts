import type { Feature } from './features.js';

/** The live region of the element, whose text screen readers announce when it changes. */
export interface Announcer extends Feature {
  /** The current text; empty without an announcement. */
  readonly text: string;
  /** Whether camera moves are not announced: during a flight, which announces its own destination. */
  isQuiet: boolean;
  /** Announces a sentence; an empty one clears the region. */
  say(text: string): void;
}
