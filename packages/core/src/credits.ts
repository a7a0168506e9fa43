/** Names to credit for a scene, and the license of its use. Each is one line of text. */
export interface Credits {
  /** Names to credit, as in `City Museum; Jane Doe`. */
  readonly attribution?: string | undefined;
  /** SPDX identifier such as `CC-BY-4.0`, or a few words. */
  readonly license?: string | undefined;
}
