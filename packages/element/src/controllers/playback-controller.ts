import type { Attributes } from '../attributes.js';

/** What a playback tells its element: names of HTMLMediaElement's events. */
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
  /** `time`: seconds at which a scene begins. */
  readonly attributes: Pick<Attributes, 'loop' | 'time'>;
  /** Asks for a frame: while it plays, or after a seek. */
  requestFrame(): void;
  playbackEvent(type: PlaybackEvent): void;
}

/** Between two timeupdate events while it plays, ms: as browsers have it for video. */
const UPDATE_INTERVAL_MS = 250;

/** The clock of a scene that moves, with the words and events of HTMLMediaElement. It is asked for the time once a frame. */
export class PlaybackController {
  readonly #host: PlaybackHost;
  #time = 0;
  /** Where the next scene begins, if somebody has said so: HTML's default playback start position. */
  #nextStart: number | undefined;
  #duration = NaN;
  #rate = 1;
  #isPaused = true;
  #hasEnded = false;
  #seekTarget: number | undefined;
  #lastTick: number | undefined;
  #lastUpdate = -Infinity;
  /** What the time shows was not there. */
  #isWaiting = false;
  /** Give up waiting to play. */
  readonly #waits = new Set<(reason: DOMException) => void>();
  #pauses = 0;

  constructor(host: PlaybackHost) {
    this.#host = host;
  }

  /** Seconds; NaN while there is no scene that moves, Infinity for one without an end. */
  get duration(): number {
    return this.#duration;
  }

  /** True for a scene that moves. */
  get canPlay(): boolean {
    return !Number.isNaN(this.#duration);
  }

  /** Where the time is; without a scene that moves, where one will begin. */
  get currentTime(): number {
    return this.canPlay && this.#nextStart === undefined ? this.#time : this.nextStart;
  }

  /** Where the next scene begins. */
  get nextStart(): number {
    const seconds = Number(this.#host.attributes.time);
    return this.#nextStart ?? (Number.isFinite(seconds) ? Math.max(0, seconds) : 0);
  }

  /** Seeks: events follow once the frame of that time is on show. Before there is a scene this is where it starts. */
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

  /** The next scene that moves begins there. A scene that is on show and stays is sought there by {@link keepScene}. */
  startNextAt(seconds: number): void {
    requireFinite(seconds);
    this.#nextStart = Math.max(0, seconds);
  }

  /** No other scene will take the place of the one on show after all. */
  keepScene(): void {
    if (this.canPlay && this.#nextStart !== undefined) this.currentTime = this.#nextStart;
  }

  /** It begins again at its end. */
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
    // While it stood there were no ticks.
    if (this.#rate === 0) this.suspend();
    this.#rate = rate;
    this.#host.playbackEvent('ratechange');
    this.#host.requestFrame();
  }

  play(): void {
    if (!this.#isPaused) return;
    this.#isPaused = false;
    const isReverse = this.#rate < 0;
    // From the other end, as browsers have it for video.
    if (this.#hasEnded || (!this.loops && this.#time === (isReverse ? 0 : this.#duration)))
      this.currentTime = isReverse && Number.isFinite(this.#duration) ? this.#duration : 0;
    this.#host.playbackEvent('play');
    this.#lastTick = undefined;
    this.#host.requestFrame();
  }

  /** How often it was told to {@link pause}. */
  get pauses(): number {
    return this.#pauses;
  }

  /** Waits for a scene to play. Rejects with an `AbortError` once it need not any more: see {@link stopWaits}. */
  waitFor(ready: Promise<void>): Promise<void> {
    return new Promise((resolve, reject) => {
      this.#waits.add(reject);
      void ready.then(resolve).finally(() => this.#waits.delete(reject));
    });
  }

  /** Takes back every play that waits. */
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

  /** The scene is there, or is there again; NaN: it does not move. */
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
   * Moves on to the moment of a frame.
   * @param now requestAnimationFrame's clock, ms
   * @param isLacking what the time shows is not there: it stands until it is
   */
  tick(now: number, isLacking = false): void {
    if (this.#isPaused || Number.isNaN(this.#duration)) return;
    if (isLacking) {
      if (this.#lastTick !== undefined) this.#host.playbackEvent('waiting');
      this.#isWaiting = true;
      return this.suspend();
    }
    if (this.#isWaiting) this.#host.playbackEvent('canplay');
    this.#isWaiting = false;
    if (this.#lastTick === undefined) this.#host.playbackEvent('playing');
    const elapsed = this.#lastTick === undefined ? 0 : (now - this.#lastTick) / 1000;
    this.#lastTick = now;
    this.#advance(elapsed * this.#rate);
    if (this.#isPaused) return;
    if (now - this.#lastUpdate >= UPDATE_INTERVAL_MS) {
      this.#lastUpdate = now;
      this.#host.playbackEvent('timeupdate');
    }
    if (this.#rate !== 0) this.#host.requestFrame();
  }

  /** A pause of the picture is not time that passes: nothing is drawn until the next tick. */
  suspend(): void {
    this.#lastTick = undefined;
  }

  /** The scene is gone, or another was asked for, whose time starts anew. */
  empty(): void {
    const couldPlay = this.canPlay;
    this.#duration = NaN;
    this.#seekTarget = undefined;
    this.#hasEnded = false;
    this.suspend();
    this.#rest();
    if (couldPlay) this.#host.playbackEvent('durationchange');
  }

  /** The frame of a time is on show. */
  frameShown(seconds: number): void {
    if (this.#seekTarget === undefined || seconds !== this.#seekTarget) return;
    this.#seekTarget = undefined;
    this.#host.playbackEvent('timeupdate');
    this.#host.playbackEvent('seeked');
  }

  #advance(seconds: number): void {
    const next = this.#time + seconds;
    // While it plays a seek is over as soon as the clock has gone on.
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

/** Why a scene that was to be played is not. */
export const notPlayed = (): DOMException =>
  new DOMException('play() was taken back by pause() or another src', 'AbortError');
