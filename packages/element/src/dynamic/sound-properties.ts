/** Additional properties of elements with a child with `slot="sound"`: same as on HTMLMediaElement. */
export interface SoundProperties {
  /** Whether the sound is muted. */
  muted?: boolean;
  /** 0..1 */
  volume?: number;
}
