/** Additional properties of elements that have a child with `slot="sound"`, as those of HTMLMediaElement. */
export interface SoundProperties {
  /** Whether the sound is muted; true without a sound. */
  muted?: boolean;
  /** Volume of the sound, 0..1. */
  volume?: number;
}
