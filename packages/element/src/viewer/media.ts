import { SplatProperties } from './properties.js';
import type { Timeline } from '../sources/generator/dynamic-model.js';
import type { Viewer } from './viewer.js';
import { SceneTimeRanges } from './time-ranges.js';
import type { LitElement } from 'lit';

/**
 * Properties that a page may set, for the typings of frameworks: those of the attributes, `currentTime` and
 * `playbackRate`. Methods and read-only properties (`error`, `duration`, ...) are excluded, because a framework that
 * sets them throws.
 */
export type SettableProperties = Partial<
  Pick<SplatProperties, Exclude<keyof SplatProperties, keyof LitElement>> &
    Pick<MediaProperties, 'currentTime' | 'playbackRate'>
>;

/**
 * Values of HTMLMediaElement.readyState: no data, the duration without the current frame, only the current frame, and
 * enough data to play.
 */
const HAVE_NOTHING = 0;
const HAVE_METADATA = 1;
const HAVE_CURRENT_DATA = 2;
const HAVE_ENOUGH_DATA = 4;

const isSaid = (value: number | null | undefined): boolean => value !== null && value !== undefined;

/** Playback of an animated scene, with the interface of HTMLMediaElement, so that controls for video work. */
export abstract class MediaProperties extends SplatProperties {
  /** @internal */
  protected abstract readonly core: Viewer;
  /** Fulfills when the scene is shown or nothing is pending. */
  abstract get ready(): Promise<void>;

  /**
   * Playback position in seconds. Setting it seeks. If it is set before a scene is loaded, or just after another `src`,
   * it is the start position of that scene.
   */
  get currentTime(): number {
    const { playback } = this.core;
    return this.isUpdatePending && this.core.sources.ownEntry.isLeaving ? playback.nextStart : playback.currentTime;
  }

  set currentTime(seconds: number) {
    // Frameworks set undefined or null to unset a property.
    if (isSaid(seconds)) this.core.sources.ownEntry.seek(seconds);
  }

  /** Duration in seconds; NaN without an animated scene, Infinity for one without an end. */
  get duration(): number {
    return this.core.playback.duration;
  }

  /** Whether playback is paused; true if nothing is animated. */
  get paused(): boolean {
    return this.core.playback.paused;
  }

  /** Whether playback has reached its end. */
  get ended(): boolean {
    return this.core.playback.ended;
  }

  /** Whether the scene is seeking: the frame of the last set time is not shown yet. */
  get seeking(): boolean {
    return this.core.playback.seeking;
  }

  /** Speed of playback; 1 is real time, negative values play backwards. */
  get playbackRate(): number {
    return this.core.playback.playbackRate;
  }

  set playbackRate(rate: number) {
    this.core.playback.playbackRate = isSaid(rate) ? rate : 1;
  }

  /**
   * State of loading as on HTMLMediaElement: 0 without a scene, 1 when its duration is known or while a clip seeks a
   * frame that is not loaded, 2 while a clip waits for its next frames, 4 when a scene is shown.
   */
  get readyState(): number {
    const { sources, playback } = this.core;
    if (sources.state !== 'ready') return playback.canPlay ? HAVE_METADATA : HAVE_NOTHING;
    if (!((this.#live?.loadedUntil?.(this.currentTime) as number) <= this.currentTime)) return HAVE_ENOUGH_DATA;
    return this.seeking ? HAVE_METADATA : HAVE_CURRENT_DATA;
  }

  /** Times that can be sought: the whole duration of a scene with an end; empty for other scenes. */
  get seekable(): SceneTimeRanges {
    return new SceneTimeRanges(this.duration);
  }

  /** Times that need no further download: the whole duration, but only the loaded groups of frames of a clip. */
  get buffered(): SceneTimeRanges {
    return new SceneTimeRanges(this.duration, this.#live?.buffered);
  }

  get #live(): Timeline | undefined {
    return this.core.sources.ownEntry.member?.scene.live;
  }

  /** Fetches the scene again, as if `src` had just been set: after an error, or when the file has changed. */
  load(): void {
    this.core.sources.ownEntry.reload();
  }

  /**
   * Starts playback when the scene is loaded. Dismisses a manual poster, and loads a lazy scene that is out of view.
   * The page draws frames at its own rate; a generator runs as often as it can.
   * @returns Rejects with a `NotSupportedError` if there is no animated scene, and with an `AbortError` if `pause()` or
   * another `src` intervenes.
   */
  play(): Promise<void> {
    // A scene that is shown plays, also while a child loads.
    return this.core.playback.playWhenReady(this.core.sources.ownEntry.requested(), () => {
      this.core.prepareToPlay();
      return this.ready;
    });
  }

  /** Pauses playback. */
  pause(): void {
    this.core.sources.ownEntry.begin();
    this.core.playback.pause();
  }
}
