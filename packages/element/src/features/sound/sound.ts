/** Plays sound with animated scenes. The module is loaded only if an element has a child with `slot="sound"`. */
import { css } from 'lit';
import type { ViewerElement } from '../../viewer/element-host.js';
import { adoptStyles } from '../../viewer/styles.js';

const STYLES = css`
  .captions {
    position: absolute;
    inset-inline: 5%;
    inset-block-end: 12%;
    z-index: 1;
    text-align: center;
    pointer-events: none;
  }
  .captions span {
    padding: 2px 8px;
    font: var(--captions-font, 600 18px / 1.5 system-ui, sans-serif);
    color: var(--captions-color, rgb(255 255 255));
    background: var(--captions-background, rgb(0 0 0 / 0.8));
    white-space: pre-line;
    box-decoration-break: clone;
  }
`;

/** Maximum offset between sound and scene that is not corrected, seconds. */
const NEAR = 0.015;
/** Offset above which the sound seeks, seconds. For smaller offsets its speed is adjusted. */
const FAR = 0.12;
/** Relative change of the speed for each second of offset. */
const GAIN = 2;
/** Maximum relative change of the speed. It is inaudible, because browsers preserve the pitch. */
const MAX_BEND = 0.1;
/** Time without a move of the scene's clock after which the sound pauses, ms, because the image does not change. */
const STILL_MS = 1_000;
/** Minimum and maximum playback rate that browsers support; 1 is real time. */
const [SLOWEST, FASTEST] = [0.0625, 16];

/** Synchronizes an `<audio>` or `<video>` of the page with an animated scene, and shows its captions. */
export class Sound {
  readonly #element: ViewerElement;
  readonly #captions: HTMLElement;
  #track: HTMLMediaElement | undefined;
  #listening: AbortController | undefined;
  /** Handle of the requested animation frame; 0 while the sound does not follow the clock. */
  #frame = 0;
  /** Time of the scene, in seconds, when the sound was last aligned. */
  #alignedTo = NaN;
  /** Whether the browser has refused to play until the visitor interacts with the page. */
  #isRefused = false;
  #still: ReturnType<typeof setTimeout> | undefined;

  constructor(element: ViewerElement) {
    this.#element = element;
    adoptStyles(element.shadowRoot!, STYLES);
    this.#captions = Object.assign(element.ownerDocument.createElement('div'), { className: 'captions' });
    this.#captions.setAttribute('part', 'captions');
    // `timeupdate` is fired by a clock that moves again without another event, as after a long task of the page.
    const types = ['play', 'playing', 'waiting', 'pause', 'seeking', 'seeked', 'ratechange', 'emptied', 'timeupdate'];
    for (const type of types) element.addEventListener(type, () => this.#follow());
    Object.defineProperties(element, {
      muted: { get: () => this.#track?.muted ?? true, set: (isMuted: boolean) => this.#set('muted', isMuted) },
      volume: { get: () => this.#track?.volume ?? 1, set: (volume: number) => this.#set('volume', volume) },
    });
  }

  /** Call when the child with `slot="sound"` may have been added, replaced or removed. */
  childrenChanged(): void {
    const child = this.#element.querySelector<HTMLMediaElement>(':scope > :is(audio, video)[slot=sound]') ?? undefined;
    if (child === this.#track) return;
    this.#listening?.abort();
    this.#track?.pause();
    this.#track = child;
    this.#captions.remove();
    if (child) this.#listen(child);
    this.#follow();
    this.#element.dispatchEvent(new Event('volumechange'));
  }

  #set<Name extends 'muted' | 'volume'>(name: Name, value: HTMLMediaElement[Name]): void {
    if (this.#track) this.#track[name] = value;
  }

  #listen(child: HTMLMediaElement): void {
    this.#listening = new AbortController();
    this.#isRefused = false;
    const { signal } = this.#listening;
    child.addEventListener('volumechange', () => this.#element.dispatchEvent(new Event('volumechange')), { signal });
    child.addEventListener('canplay', () => this.#follow(), { signal });
    const showCues = (): void => this.#show(child.textTracks);
    child.textTracks.addEventListener('change', showCues, { signal });
    const watch = (track: TextTrack): void => track.addEventListener('cuechange', showCues, { signal });
    for (const track of child.textTracks) watch(track);
    child.textTracks.addEventListener('addtrack', ({ track }) => track && watch(track), { signal });
    this.#element.shadowRoot!.append(this.#captions);
  }

  #show(tracks: TextTrackList): void {
    const shown = [...tracks].filter(
      ({ kind, mode }) => mode === 'showing' && (kind === 'captions' || kind === 'subtitles'),
    );
    const cues = shown.flatMap(({ activeCues }) => [...(activeCues ?? [])] as VTTCue[]);
    this.#captions.replaceChildren(
      ...cues.flatMap((cue) => {
        const line = this.#element.ownerDocument.createElement('span');
        line.append(cue.getCueAsHTML());
        return [line, this.#element.ownerDocument.createElement('br')];
      }),
    );
    const language = shown.find(({ activeCues }) => activeCues?.length)?.language;
    this.#captions.lang = language ?? '';
  }

  /** Whether the scene plays forwards, with its frames available, at a rate that sound supports. */
  get #moves(): boolean {
    const { paused, seeking, playbackRate, readyState } = this.#element;
    const hasSpeed = playbackRate >= SLOWEST && playbackRate <= FASTEST;
    return !paused && !seeking && hasSpeed && readyState > HTMLMediaElement.HAVE_CURRENT_DATA;
  }

  #follow(): void {
    if (!this.#track || !this.#moves) return this.#rest();
    if (this.#frame !== 0) return;
    this.#alignedTo = this.#element.currentTime;
    this.#expectMoves();
    this.#frame = requestAnimationFrame(this.#step);
  }

  /** Ends the alignment if the clock of the scene does not advance, as while nothing is drawn out of view. */
  #expectMoves(): void {
    clearTimeout(this.#still);
    this.#still = setTimeout(() => this.#rest(), STILL_MS);
  }

  /** Runs once in each frame while the scene plays, and aligns the sound. */
  readonly #step = (frameTime: number): void => {
    const track = this.#track;
    if (!track || !this.#moves) return this.#rest();
    this.#frame = requestAnimationFrame(this.#step);
    // Deferred until all callbacks of the frame have run, so that the clock of the scene has advanced.
    setTimeout(() => this.#frame !== 0 && track === this.#track && this.#align(track, frameTime));
  };

  #align(track: HTMLMediaElement, frameTime: number): void {
    const { currentTime, playbackRate } = this.#element;
    const hasMoved = currentTime !== this.#alignedTo;
    this.#alignedTo = currentTime;
    if (hasMoved) this.#expectMoves();
    if (!hasMoved || track.seeking || track.readyState < HTMLMediaElement.HAVE_METADATA) return;
    const now = currentTime + (playbackRate * (performance.now() - frameTime)) / 1000;
    if (now >= track.duration) return track.pause();
    const late = now - track.currentTime;
    const share = late / playbackRate;
    if (Math.abs(share) > FAR) track.currentTime = now;
    const isOff = Math.abs(share) > NEAR && Math.abs(share) <= FAR;
    const bend = isOff ? Math.max(-MAX_BEND, Math.min(MAX_BEND, GAIN * share)) : 0;
    const speed = Math.min(FASTEST, Math.max(SLOWEST, playbackRate * (1 + bend)));
    if (track.playbackRate !== speed) track.playbackRate = speed;
    if (track.paused) this.#start(track);
  }

  /**
   * Starts the sound. If the browser refuses to play before the visitor interacts with the page, the sound starts after
   * that interaction.
   */
  #start(track: HTMLMediaElement): void {
    if (this.#isRefused) return;
    track.play().catch(({ name }: DOMException) => {
      const signal = this.#listening?.signal;
      if (name !== 'NotAllowedError' || !signal) return;
      this.#isRefused = true;
      const retry = (): void => void (this.#isRefused = false);
      for (const type of ['pointerup', 'keydown'])
        this.#element.ownerDocument.addEventListener(type, retry, { signal, once: true, capture: true });
    });
  }

  #rest(): void {
    cancelAnimationFrame(this.#frame);
    this.#frame = 0;
    clearTimeout(this.#still);
    const track = this.#track;
    if (!track) return;
    track.pause();
    const { currentTime } = this.#element;
    // Seeks to the time of the paused frame, so that its captions are shown.
    if (track.readyState > 0 && Math.abs(track.currentTime - currentTime) > NEAR)
      track.currentTime = Math.min(currentTime, track.duration || currentTime);
  }
}
