import { notPlayed } from './controllers/playback-controller.js';
import { SplatProperties } from './properties.js';
import type { Timeline } from './live/live-model.js';
import type { Stage } from './stage.js';
import { SceneTimeRanges } from './time-ranges.js';
import type { LitElement } from 'lit';

/**
 * The properties that a page may set, for the typings of frameworks: those of the attributes, and of time `currentTime` and `playbackRate`.
 * Methods and what can only be read (`error`, `duration`, ...) are left out: a framework that sets them throws.
 */
export type SettableProperties = Partial<
  Pick<SplatProperties, Exclude<keyof SplatProperties, keyof LitElement>> &
    Pick<MediaProperties, 'currentTime' | 'playbackRate'>
>;

/** What HTMLMediaElement.readyState says of a scene: nothing yet, the last image and no more, or all that comes next. */
const HAVE_NOTHING = 0;
const HAVE_CURRENT_DATA = 2;
const HAVE_ENOUGH_DATA = 4;

const isSaid = (value: number | null | undefined): boolean => value !== null && value !== undefined;

/** Time of a scene that moves, in the words of HTMLMediaElement: whatever drives a video drives it. */
export abstract class MediaProperties extends SplatProperties {
  /** @internal */
  protected abstract readonly stage: Stage;
  /** Fulfils when there is nothing left to wait for. */
  abstract get ready(): Promise<void>;

  /** Seconds into a scene that moves; setting it seeks. Set before there is one, or just after another `src`, it is where that one begins. */
  get currentTime(): number {
    const { playback } = this.stage;
    return this.isUpdatePending && this.stage.sources.own.isLeaving ? playback.nextStart : playback.currentTime;
  }

  set currentTime(seconds: number) {
    // Frameworks say so of a property that they do not set any more.
    if (isSaid(seconds)) this.stage.seek(seconds);
  }

  /** Seconds; NaN while there is no scene that moves, Infinity for one without an end. */
  get duration(): number {
    return this.stage.playback.duration;
  }

  /** Whether the time stands still; true where nothing moves. */
  get paused(): boolean {
    return this.stage.playback.paused;
  }

  /** Whether the time has come to its end. */
  get ended(): boolean {
    return this.stage.playback.ended;
  }

  /** True until the frame of the time that was set is shown. */
  get seeking(): boolean {
    return this.stage.playback.seeking;
  }

  /** Speed of the time; 1 is that of the clock, negative runs backwards. */
  get playbackRate(): number {
    return this.stage.playback.playbackRate;
  }

  set playbackRate(rate: number) {
    this.stage.playback.playbackRate = isSaid(rate) ? rate : 1;
  }

  /** As of HTMLMediaElement: 0 while there is no scene, 4 once it is shown, 2 while a clip has to wait for what comes next. */
  get readyState(): number {
    if (this.stage.sources.state !== 'ready') return HAVE_NOTHING;
    return this.#live?.isLacking?.(this.currentTime) ? HAVE_CURRENT_DATA : HAVE_ENOUGH_DATA;
  }

  /** Times that can be sought: all of a scene with an end, none of others. */
  get seekable(): SceneTimeRanges {
    return new SceneTimeRanges(this.duration);
  }

  /** Times that need no more bytes: the same, but for a clip, of which groups come and go. */
  get buffered(): SceneTimeRanges {
    return new SceneTimeRanges(this.duration, this.#live?.buffered);
  }

  get #live(): Timeline | undefined {
    return this.stage.sources.own.member?.scene.live;
  }

  /** Fetches the scene again, as if `src` had just been set: after an error, or when the file has changed. */
  load(): void {
    this.stage.sources.own.reload();
  }

  /**
   * Lets the time run, once the scene is there. Frames are drawn as the page has them; the generator follows as fast as it can.
   * A poster that waits for a person gives way, and a lazy scene out of sight is loaded.
   * @returns rejects with a `NotSupportedError` where there is no scene that moves, and with an `AbortError` if `pause()` or another
   * `src` comes before it does.
   */
  async play(): Promise<void> {
    const { playback } = this.stage;
    const { pauses } = playback;
    // A scene that was set a moment ago is asked for first: the end of the one before is no reason to give up.
    await this.updateComplete;
    if (playback.pauses !== pauses) throw notPlayed();
    this.stage.prepareToPlay();
    await playback.waitFor(this.ready);
    if (!playback.canPlay) throw new DOMException('There is no scene that moves', 'NotSupportedError');
    playback.play();
  }

  /** Lets the time stand still. */
  pause(): void {
    this.stage.sources.own.hasBegun = true;
    this.stage.playback.pause();
  }
}
