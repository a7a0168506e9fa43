import type { Attributes } from './attributes.js';

/** Names of the events of a playback, as those of HTMLMediaElement. */
export type PlaybackEvent =
  | 'play'
  | 'playing'
  | 'waiting'
  | 'pause'
  | 'timeupdate'
  | 'seeking'
  | 'seeked'
  | 'ended'
  | 'ratechange'
  | 'durationchange'
  | 'loadedmetadata'
  | 'loadstart'
  | 'loadeddata'
  | 'canplay'
  | 'canplaythrough'
  | 'emptied';

export interface PlaybackHost {
  /** `loop`: whether a scene restarts at its end. `time`: start position of a scene in seconds, as a string. */
  readonly attributes: Pick<Attributes, 'loop' | 'time'>;
  /** Called to request a frame while the scene plays, and after a seek. */
  requestFrame(): void;
  playbackEvent(type: PlaybackEvent): void;
}

/** The part of a clock that a button for automatic motion uses. */
export type Player = Pick<PlaybackController, 'canPlay' | 'paused' | 'play' | 'pause'>;

/** Events of a scene that can be played, as a video fires them for HAVE_ENOUGH_DATA. */
export const PLAYABLE = ['canplay', 'canplaythrough'] as const;

/** Minimum interval between `timeupdate` events during playback, ms, as in browsers for video. */
const UPDATE_INTERVAL_MS = 250;

/**
 * The clock of an animated scene, with the interface and events of HTMLMediaElement. The view reads the clock once in
 * each frame.
 */
export class PlaybackController {
  readonly #host: PlaybackHost;
  #time = 0;
  /**
   * Start position of the next scene in seconds, as HTML's default playback start position; undefined if no script has
   * set it.
   */
  #nextStart: number | undefined;
  #duration = NaN;
  #rate = 1;
  #isPaused = true;
  #hasEnded = false;
  #seekTarget: number | undefined;
  #lastTick: number | undefined;
  #lastUpdate = -Infinity;
  /** Whether the clock waits, because the frame at the current time is not loaded. */
  #isWaiting = false;
  /** Functions that reject the promises of pending calls of `play`. */
  readonly #waits = new Set<(reason: DOMException) => void>();
  #pauses = 0;

  constructor(host: PlaybackHost) {
    this.#host = host;
  }

  /** Duration in seconds; NaN without an animated scene, Infinity for a scene without an end. */
  get duration(): number {
    return this.#duration;
  }

  /** Whether there is an animated scene that can be played. */
  get canPlay(): boolean {
    return !Number.isNaN(this.#duration);
  }

  /** Current position in seconds; without an animated scene, the start position of the next one. */
  get currentTime(): number {
    return this.canPlay && this.#nextStart === undefined ? this.#time : this.nextStart;
  }

  /**
   * Start position of the next scene in seconds: the last one that a script has set, otherwise the attribute `time`,
   * otherwise 0.
   */
  get nextStart(): number {
    const seconds = Number(this.#host.attributes.time);
    return this.#nextStart ?? (Number.isFinite(seconds) ? Math.max(0, seconds) : 0);
  }

  /**
   * Seeks to a time in seconds; `seeked` is fired when the frame at that time is shown. Without an animated scene, this
   * sets the start position of the next one. Throws TypeError if the time is not finite.
   */
  set currentTime(seconds: number) {
    if (!this.canPlay) {
      this.startNextAt(seconds);
      return;
    }
    requireFinite(seconds);
    this.#nextStart = undefined;
    this.#time = Math.min(this.#duration, Math.max(0, seconds));
    this.#hasEnded = false;
    this.#seekTarget = this.#time;
    this.#host.playbackEvent('seeking');
    this.#host.requestFrame();
  }

  /**
   * Sets the start position of the next animated scene, in seconds. If the current scene is kept, {@link keepScene}
   * seeks it. Throws TypeError if the position is not finite.
   */
  startNextAt(seconds: number): void {
    requireFinite(seconds);
    this.#nextStart = Math.max(0, seconds);
  }

  /** Call if the current scene is kept although a start position was set: seeks the current scene to that position. */
  keepScene(): void {
    if (this.canPlay && this.#nextStart !== undefined) this.currentTime = this.#nextStart;
  }

  /** Whether the scene restarts at its end. */
  get loops(): boolean {
    return this.#host.attributes.loop;
  }

  get seeking(): boolean {
    return this.#seekTarget !== undefined;
  }

  get paused(): boolean {
    return this.#isPaused;
  }

  get ended(): boolean {
    return this.#hasEnded;
  }

  get playbackRate(): number {
    return this.#rate;
  }

  set playbackRate(rate: number) {
    requireFinite(rate, 'playbackRate');
    if (rate === this.#rate) return;
    // At rate 0 no frames are requested, so the time since the last tick must not count.
    if (this.#rate === 0) this.suspend();
    this.#rate = rate;
    this.#host.playbackEvent('ratechange');
    this.#host.requestFrame();
  }

  play(): void {
    if (!this.#isPaused) return;
    this.#isPaused = false;
    const isReverse = this.#rate < 0;
    // At its end, playback starts again from the other end, as browsers do for video.
    if (this.#hasEnded || (!this.loops && this.#time === (isReverse ? 0 : this.#duration)))
      this.currentTime = isReverse && Number.isFinite(this.#duration) ? this.#duration : 0;
    this.#host.playbackEvent('play');
    this.#lastTick = undefined;
    this.#host.requestFrame();
  }

  /** Number of calls of {@link pause} until now. */
  get pauses(): number {
    return this.#pauses;
  }

  /**
   * Plays when a scene can be played, for `play()` of elements.
   * @param requested Fulfills when the scene of the attributes is requested, so that the removal of the previous scene
   * does not reject the result. Rejects if that scene is not to be played.
   * @param ready Returns a promise that fulfills when the scene is shown or nothing is pending.
   * @returns Rejects with a `NotSupportedError` if nothing is animated, and with an `AbortError` if {@link pause} or
   * {@link stopWaits} is called first.
   */
  async playWhenReady(requested: Promise<unknown>, ready: () => Promise<void>): Promise<void> {
    await requested;
    const isReady = ready();
    if (!this.canPlay)
      await new Promise<void>((resolve, reject) => {
        this.#waits.add(reject);
        void isReady.then(resolve).finally(() => this.#waits.delete(reject));
      });
    if (!this.canPlay) throw new DOMException('There is no scene that moves', 'NotSupportedError');
    this.play();
  }

  /** Rejects the promises of all pending calls of `play`. */
  stopWaits(): void {
    for (const reject of this.#waits) reject(notPlayed());
  }

  pause(): void {
    this.#pauses++;
    this.stopWaits();
    this.#rest();
  }

  #rest(): void {
    if (this.#isPaused) return;
    this.#isPaused = true;
    this.#isWaiting = false;
    this.#host.playbackEvent('timeupdate');
    this.#host.playbackEvent('pause');
  }

  /**
   * Sets the duration of the scene in seconds; NaN if it is not animated. Call when the scene is loaded, or loaded
   * again.
   */
  setDuration(seconds: number): void {
    if (Object.is(seconds, this.#duration)) return;
    if (!Number.isNaN(seconds)) {
      this.#time = Math.min(this.currentTime, seconds);
      this.#nextStart = undefined;
    }
    this.#duration = seconds;
    this.#host.playbackEvent('durationchange');
    if (this.canPlay) this.#host.playbackEvent('loadedmetadata');
    this.#host.requestFrame();
  }

  /**
   * Advances the clock to the time of a frame.
   * @param now requestAnimationFrame's clock, ms.
   * @param until Time of the next frame that is not loaded, s. The clock stops there until that frame is loaded.
   */
  tick(now: number, until = Infinity): void {
    if (this.#isPaused || Number.isNaN(this.#duration)) return;
    const time = this.#time;
    if (until <= time) {
      if (!this.#isWaiting) this.#host.playbackEvent('waiting');
      this.#isWaiting = true;
      return this.suspend();
    }
    if (this.#isWaiting) for (const type of PLAYABLE) this.#host.playbackEvent(type);
    this.#isWaiting = false;
    const last = this.#lastTick;
    if (last === undefined) this.#host.playbackEvent('playing');
    const seconds = last === undefined ? 0 : ((now - last) / 1000) * this.#rate;
    this.#lastTick = now;
    // During playback a seek ends as soon as the clock advances.
    if (seconds !== 0) this.frameShown(this.#seekTarget);
    // Listeners of these events may have paused, or sought another time.
    if (this.#isPaused || this.#time !== time) return;
    this.#advance(Math.min(seconds, until - time));
    if (this.#isPaused) return;
    if (now - this.#lastUpdate >= UPDATE_INTERVAL_MS) {
      this.#lastUpdate = now;
      this.#host.playbackEvent('timeupdate');
    }
    if (this.#rate !== 0) this.#host.requestFrame();
  }

  /** Stops the clock until the next tick. Call while nothing is drawn, so that this time does not count. */
  suspend(): void {
    this.#lastTick = undefined;
  }

  /** Resets the clock. Call when the scene is removed, or another scene is requested. */
  empty(): void {
    const couldPlay = this.canPlay;
    this.#duration = NaN;
    this.#seekTarget = undefined;
    this.#hasEnded = false;
    this.suspend();
    this.#rest();
    if (couldPlay) this.#host.playbackEvent('durationchange');
  }

  /** Call when the frame at a time, in seconds, is shown. Ends the seek to that time; undefined has no effect. */
  frameShown(seconds: number | undefined): void {
    if (seconds === undefined || seconds !== this.#seekTarget) return;
    this.#seekTarget = undefined;
    this.#host.playbackEvent('timeupdate');
    this.#host.playbackEvent('seeked');
  }

  #advance(seconds: number): void {
    const next = this.#time + seconds;
    const isWithin = this.#rate < 0 ? next > 0 && next <= this.#duration : next >= 0 && next < this.#duration;
    if (isWithin) {
      this.#time = next;
    } else if (this.loops && Number.isFinite(this.#duration) && this.#duration > 0) {
      this.#time = next - this.#duration * Math.floor(next / this.#duration);
    } else {
      this.#end(this.#rate < 0 ? 0 : this.#duration);
    }
  }

  #end(time: number): void {
    this.#time = time;
    this.#isPaused = true;
    this.#hasEnded = true;
    for (const type of ['timeupdate', 'pause', 'ended'] as const) this.#host.playbackEvent(type);
    this.#host.requestFrame();
  }
}

function requireFinite(value: number, name = 'currentTime'): void {
  if (!Number.isFinite(value)) throw new TypeError(`${name} expects a finite number, found ${value}`);
}

/** Returns the `AbortError` with which a canceled `play()` rejects. */
export const notPlayed = (): DOMException =>
  new DOMException('play() was interrupted by pause() or another src', 'AbortError');
