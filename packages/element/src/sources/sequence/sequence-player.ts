/** Plays sequences of scene files. The module is loaded only for sequences. */
import { type Bounds, type Credits } from '@gaussian-splat/core';
import { BackOff, fileRequest } from '@gaussian-splat/core/fetch';
import { frameAt, framePath, type SceneSequence } from '@gaussian-splat/formats';
import { SequenceGaussians, type PackedGaussians } from '@gaussian-splat/renderer';
import { LoadedGaussians } from '../../gpu/loaded-gaussians.js';
import type { LoadedScene, LoadedSequence, ProgressListener, SceneRequest } from '../../loading/protocol.js';
import type { SceneLoader } from '../../loading/scene-loader.js';
import { FrameRoom } from '../generator/frame-room.js';
import { indicesFrom, PlayDirection } from '../play-direction.js';
import type { OpenSource } from '../source-kind.js';
import type { DynamicListeners, DynamicState, Timeline } from '../generator/dynamic-model.js';

export interface SequenceOptions {
  readonly request: SceneRequest;
  readonly device: GPUDevice;
  readonly loader: SceneLoader;
  readonly signal: AbortSignal;
  readonly onProgress: ProgressListener;
  readonly listeners: DynamicListeners;
  readonly frameUrl: (url: string) => string;
  readonly loops: () => boolean;
  readonly memoryBudget: number | undefined;
  /** Called with the size of the first frame, in bytes, before its upload. */
  readonly beforeUpload: (byteLength: number) => void;
}

/** Number of frames that are fetched and unpacked concurrently. */
const AT_ONCE = 3;

/**
 * Delay before a failed frame is requested again, ms: four times as long after each further failure. The second
 * constant is the maximum number of attempts.
 */
const RETRY_MS = 5_000;
const MAX_TRIES = 4;

/** A frame in transit, or a loaded frame, which has `packed`. */
interface FetchedFrame {
  readonly abort: AbortController;
  packed?: PackedGaussians;
}

/**
 * Plays a sequence of scene files. The worker fetches and unpacks the next frames, as many as the memory limit allows.
 * If a frame is late, the previous one stays visible.
 */
export class SequencePlayer implements Timeline {
  readonly duration: number;
  readonly bounds: Bounds;
  /** Credits of the manifest, or else of the first frame. */
  readonly credits: Credits | undefined;
  /** Scene that shows the sequence. Its creator sets this property once. */
  scene: LoadedGaussians | undefined;
  readonly #sequence: SceneSequence;
  readonly #options: SequenceOptions;
  readonly #slots = new Map<number, FetchedFrame>();
  /** Failures of downloads, by frame. */
  readonly #failures = new BackOff<number>({ firstMs: RETRY_MS, factor: 4, maxTries: MAX_TRIES });
  readonly #room: FrameRoom;
  #gaussians: SequenceGaussians;
  readonly #playing: PlayDirection;
  #shown = 0;
  #isGrowing = false;
  #isClosed = false;

  private constructor(
    options: SequenceOptions,
    sequence: SceneSequence,
    first: LoadedScene,
    gaussians: SequenceGaussians,
  ) {
    this.#options = options;
    this.#sequence = sequence;
    this.#gaussians = gaussians;
    this.duration = sequence.durationSeconds;
    this.bounds = first.bounds;
    this.credits = sequence.credits ?? first.credits;
    this.#room = new FrameRoom(sequence.frameCount, sequence.framesPerSecond);
    this.#playing = new PlayDirection(sequence.frameCount, sequence.framesPerSecond);
    this.#room.note(bytesOf(first.packed));
    this.#slots.set(0, { abort: new AbortController(), packed: first.packed });
  }

  /**
   * Opens a sequence. Resolves when its first frame is on the GPU. Rejects with GaussianSplatError, or the signal's
   * reason.
   */
  static async open(sequence: LoadedSequence, options: SequenceOptions): Promise<SequencePlayer> {
    const { device, signal, onProgress, memoryBudget, beforeUpload } = options;
    const first = await load(sequence, 0, options, 'auto', signal, onProgress);
    signal.throwIfAborted();
    beforeUpload(bytesOf(first.packed));
    const gaussians = await SequenceGaussians.create(device, first.packed, { memoryBudget });
    if (!signal.aborted) return new SequencePlayer(options, sequence, first, gaussians);
    gaussians.destroy();
    throw signal.reason;
  }

  get gaussians(): SequenceGaussians {
    return this.#gaussians;
  }

  /** Shows the frame at a time, if it is loaded, and fetches the following frames. */
  request({ timeSeconds }: DynamicState): void {
    const frame = this.#frameAt(timeSeconds);
    this.#playing.at(frame, this.#options.loops());
    this.#showLate(frame);
    this.#prefetch(frame);
    const slot = this.#slots.get(frame);
    if (frame !== this.#shown && slot?.packed) this.#show(frame);
    // An unavailable frame counts as shown, so that a seek to it ends.
    if (frame === this.#shown || this.#isMissing(frame)) this.#notify(timeSeconds);
  }

  /**
   * If the current frame is not loaded, shows the newest loaded frame that the clock has passed. If every frame is late,
   * playback thus follows the clock with a delay.
   */
  #showLate(frame: number): void {
    if (this.#slots.get(frame)?.packed) return;
    const passed = (held: number): number => this.#playing.direction * (frame - held);
    // The shown frame may belong to the previous round.
    const min = passed(this.#shown) > 0 ? passed(this.#shown) : Infinity;
    const late = [...this.#slots.keys()].filter(
      (held) => passed(held) > 0 && passed(held) < min && this.#slots.get(held)!.packed,
    );
    if (late.length > 0) this.#show(late.reduce((a, b) => (passed(a) < passed(b) ? a : b)));
  }

  close(): void {
    this.#isClosed = true;
    for (const { abort } of this.#slots.values()) abort.abort();
    this.#slots.clear();
  }

  #frameAt(timeSeconds: number): number {
    return frameAt(this.#sequence, timeSeconds);
  }

  #show(frame: number): void {
    const packed = this.#slots.get(frame)!.packed!;
    if (!this.#gaussians.fits(packed)) return void this.#grow(frame, packed);
    this.#gaussians.write(packed);
    this.#shown = frame;
  }

  /** Calls the listener after the image that is being drawn is submitted. */
  #notify(timeSeconds: number): void {
    queueMicrotask(() => this.#isClosed || this.#options.listeners.onShown(timeSeconds));
  }

  /**
   * Creates larger buffers for a frame with more splats than any frame before. The last frame stays visible meanwhile.
   */
  async #grow(frame: number, packed: PackedGaussians): Promise<void> {
    if (this.#isGrowing) return;
    this.#isGrowing = true;
    const { device, memoryBudget, listeners } = this.#options;
    try {
      const gaussians = await SequenceGaussians.create(device, packed, { memoryBudget });
      if (this.#isClosed || this.scene === undefined) return gaussians.destroy();
      this.scene.replaceGaussians(gaussians);
      this.#gaussians = gaussians;
      this.#shown = -1;
      listeners.onInput();
    } catch (error) {
      // A frame that does not fit counts as unavailable; otherwise each image would try again.
      if (this.#slots.get(frame)?.packed === packed) this.#fail(frame, error);
    } finally {
      this.#isGrowing = false;
    }
  }

  /** Fetches the next frames, nearest first, and discards frames that are not needed. */
  #prefetch(frame: number): void {
    const wanted = this.#wantedFrom(frame);
    for (const [held, { abort, packed }] of this.#slots) {
      // Frames that the clock has just passed may still arrive. On a slow connection, the clock passes every frame
      // before it arrives.
      const passed = this.#playing.direction * (frame - held);
      const isLate = passed > 0 && passed <= this.#room.frames && !packed;
      if (wanted.includes(held) || isLate) continue;
      abort.abort();
      this.#slots.delete(held);
    }
    let busy = 0;
    for (const { packed } of this.#slots.values()) if (!packed) busy++;
    for (const next of wanted) {
      if (busy >= AT_ONCE) return;
      if (this.#slots.has(next) || this.#isMissing(next)) continue;
      busy++;
      void this.#fetch(next);
    }
  }

  /** Returns whether a frame has failed and is not requested again yet. */
  #isMissing(frame: number): boolean {
    return this.#failures.isPaused(frame);
  }

  /**
   * Records the failure of a frame. Only its first failure is reported. The frame is requested again at increasing
   * intervals, up to {@link MAX_TRIES} times.
   */
  #fail(frame: number, error: unknown): void {
    this.#slots.delete(frame);
    if (this.#failures.fail(frame) === 1 && !this.#isClosed) this.#options.listeners.onError(error);
  }

  #wantedFrom(frame: number): number[] {
    const { frameCount } = this.#sequence;
    return indicesFrom(frame, this.#room.frames, this.#playing.direction, frameCount, this.#options.loops());
  }

  async #fetch(frame: number): Promise<void> {
    const slot: FetchedFrame = { abort: new AbortController() };
    this.#slots.set(frame, slot);
    const { listeners } = this.#options;
    const { shPrecision } = this.#gaussians;
    try {
      const loading = load(this.#sequence, frame, this.#options, shPrecision, slot.abort.signal, () => undefined);
      slot.packed = (await loading).packed;
      this.#failures.succeed(frame);
      this.#room.note(bytesOf(slot.packed));
    } catch (error) {
      if (slot.abort.signal.aborted) return;
      this.#fail(frame, error);
    }
    if (!slot.abort.signal.aborted) listeners.onInput();
  }
}

async function load(
  sequence: SceneSequence,
  frame: number,
  { loader, request, frameUrl }: SequenceOptions,
  precision: SceneRequest['sh'],
  signal: AbortSignal,
  onProgress: ProgressListener,
): Promise<LoadedScene> {
  const { limits } = request;
  const sh = request.sh === 'auto' ? precision : request.sh;
  const path = framePath(sequence, frame);
  const own = fileRequest(path, request, limits?.origins);
  // If the page rewrites the address, its result is used unchanged.
  const { href } = new URL(path, request.url);
  const url = frameUrl(href);
  return loader.load({ ...own, ...(url !== href && { url }), limits, sh }, signal, onProgress);
}

const bytesOf = ({ geometry, sh, chunks }: PackedGaussians): number =>
  geometry.byteLength + sh.byteLength + chunks.byteLength;

/** Opens the sequence whose manifest was found. */
export const open: OpenSource = async (request, options, acquiring, found) => {
  const lease = await acquiring;
  const { listeners, loops } = options.live();
  const player = await SequencePlayer.open(found!, { ...options, request, device: lease.device, listeners, loops });
  const { gaussians, bounds } = player;
  const scene = new LoadedGaussians(lease, gaussians, bounds, options.submissions, { live: player });
  player.scene = scene;
  return scene;
};
