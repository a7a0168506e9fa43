import type { Attributes } from '../attributes.js';

/** Events of a playback: names of HTMLMediaElement's events. */
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
  | 'emptied';

export interface PlaybackHost {
  /** `time`: initial position of a scene in seconds. */
  readonly attributes: Pick<Attributes, 'loop' | 'time'>;
  /** Requests a frame: while it plays, or after a seek. */
  requestFrame(): void;
  playbackEvent(type: PlaybackEvent): void;
}

/** Interval of timeupdate events during playback, ms: as in browsers for video. */
const UPDATE_INTERVAL_MS = 250;

/** The clock of an animated scene, with the interface and events of HTMLMediaElement. It is read once in each frame. */
export class PlaybackController {
  readonly #host: PlaybackHost;
  #time = 0;
  /** Start position of the next scene, if set: HTML's default playback start position. */
  #nextStart: number | undefined;
  #duration = NaN;
  #rate = 1;
  #isPaused = true;
  #hasEnded = false;
  #seekTarget: number | undefined;
  #lastTick: number | undefined;
  #lastUpdate = -Infinity;
  /** Whether the frame at the current time was missing. */
  #isWaiting = false;
  /** Functions that reject pending calls of play. */
  readonly #waits = new Set<(reason: DOMException) => void>();
  #pauses = 0;

  constructor(host: PlaybackHost) {
    this.#host = host;
  }

  /** Seconds; NaN without an animated scene, Infinity for one without an end. */
  get duration(): number {
    return this.#duration;
  }

  /** Whether there is an animated scene. */
  get canPlay(): boolean {
    return !Number.isNaN(this.#duration);
  }

  /** Current position; without an animated scene, the start position of the next one. */
  get currentTime(): number {
    return this.canPlay && this.#nextStart === undefined ? this.#time : this.nextStart;
  }

  /** Start position of the next scene. */
  get nextStart(): number {
    const seconds = Number(this.#host.attributes.time);
    return this.#nextStart ?? (Number.isFinite(seconds) ? Math.max(0, seconds) : 0);
  }

  /** Seeks: events follow once the frame at that time is shown. Without a scene this sets the start position. */
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

  /** Sets the start position of the next animated scene. If the current scene is kept, {@link keepScene} seeks it. */
  startNextAt(seconds: number): void {
    requireFinite(seconds);
    this.#nextStart = Math.max(0, seconds);
  }

  /** Call if the current scene is kept after all. */
  keepScene(): void {
    if (this.canPlay && this.#nextStart !== undefined) this.currentTime = this.#nextStart;
  }

  /** Whether it restarts at its end. */
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
    // There were no ticks while it was stopped.
    if (this.#rate === 0) this.suspend();
    this.#rate = rate;
    this.#host.playbackEvent('ratechange');
    this.#host.requestFrame();
  }

  play(): void {
    if (!this.#isPaused) return;
    this.#isPaused = false;
    const isReverse = this.#rate < 0;
    // Continues from the other end, as browsers do for video.
    if (this.#hasEnded || (!this.loops && this.#time === (isReverse ? 0 : this.#duration)))
      this.currentTime = isReverse && Number.isFinite(this.#duration) ? this.#duration : 0;
    this.#host.playbackEvent('play');
    this.#lastTick = undefined;
    this.#host.requestFrame();
  }

  /** Number of calls of {@link pause}. */
  get pauses(): number {
    return this.#pauses;
  }

  /** Waits for a scene to play. Rejects with an `AbortError` when the wait is canceled: see {@link stopWaits}. */
  waitFor(ready: Promise<void>): Promise<void> {
    return new Promise((resolve, reject) => {
      this.#waits.add(reject);
      void ready.then(resolve).finally(() => this.#waits.delete(reject));
    });
  }

  /** Cancels all pending calls of play. */
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
    this.#host.playbackEvent('timeupdate');
    this.#host.playbackEvent('pause');
  }

  /** Call when the scene is loaded, or loaded again; NaN: it is not animated. */
  setDuration(seconds: number): void {
    if (Object.is(seconds, this.#duration)) return;
    if (!Number.isNaN(seconds)) {
      this.#time = Math.min(this.currentTime, seconds);
      this.#nextStart = undefined;
    }
    this.#duration = seconds;
    this.#host.playbackEvent('durationchange');
    this.#host.playbackEvent('loadedmetadata');
    this.#host.requestFrame();
  }

  /**
   * Advances to the time of a frame.
   * @param now requestAnimationFrame's clock, ms.
   * @param until Time of the next frame that is not loaded, s: the clock stops there and waits for it.
   */
  tick(now: number, until = Infinity): void {
    if (this.#isPaused || Number.isNaN(this.#duration)) return;
    if (until <= this.#time) {
      if (!this.#isWaiting) this.#host.playbackEvent('waiting');
      this.#isWaiting = true;
      return this.suspend();
    }
    if (this.#isWaiting) this.#host.playbackEvent('canplay');
    this.#isWaiting = false;
    if (this.#lastTick === undefined) this.#host.playbackEvent('playing');
    const elapsed = this.#lastTick === undefined ? 0 : (now - this.#lastTick) / 1000;
    this.#lastTick = now;
    this.#advance(Math.min(elapsed * this.#rate, until - this.#time));
    if (this.#isPaused) return;
    if (now - this.#lastUpdate >= UPDATE_INTERVAL_MS) {
      this.#lastUpdate = now;
      this.#host.playbackEvent('timeupdate');
    }
    if (this.#rate !== 0) this.#host.requestFrame();
  }

  /** Time does not advance while nothing is drawn, until the next tick. */
  suspend(): void {
    this.#lastTick = undefined;
  }

  /** Call when the scene is removed, or another was requested, whose time starts again. */
  empty(): void {
    const couldPlay = this.canPlay;
    this.#duration = NaN;
    this.#seekTarget = undefined;
    this.#hasEnded = false;
    this.suspend();
    this.#rest();
    if (couldPlay) this.#host.playbackEvent('durationchange');
  }

  /** Call when the frame at a time is shown. */
  frameShown(seconds: number): void {
    if (this.#seekTarget === undefined || seconds !== this.#seekTarget) return;
    this.#seekTarget = undefined;
    this.#host.playbackEvent('timeupdate');
    this.#host.playbackEvent('seeked');
  }

  #advance(seconds: number): void {
    const next = this.#time + seconds;
    // During playback a seek ends as soon as the clock has advanced.
    if (this.#seekTarget !== undefined && seconds !== 0) this.frameShown(this.#seekTarget);
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

/** Error of a canceled play(). */
export const notPlayed = (): DOMException =>
  new DOMException('play() was taken back by pause() or another src', 'AbortError');
