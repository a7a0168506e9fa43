/** What elements have besides once they have a child with `slot="sound"`: as of HTMLMediaElement. */
export interface SoundProperties {
  /** Whether the sound is silent. */
  muted?: boolean;
  /** 0..1 */
  volume?: number;
}
