/** Videos: recorded from the screen by the browser, or frame by frame as images. */
import type { CameraController } from './controllers/camera-controller.js';
import type { PlaybackController } from './controllers/playback-controller.js';
import type { Lazy } from './lazy.js';
import { nothingToDraw, takeImage, type ImageHost } from './capture-image.js';
import type { ImageOptions } from './viewing.js';
import { frameCount, frameShares, type CameraPath, type PathName } from './views/camera-path.js';
import type { Tour } from './views/tour.js';

/** Content and duration of a video. */
interface VideoOptions {
  /** Path of the camera: through the list of `views`, or once around its target. Default: the camera of the element. */
  readonly path?: PathName;
  /** Milliseconds. Default: what the path says. */
  readonly duration?: number;
  /** Frames in a second. Default 30. */
  readonly frameRate?: number;
}

/** A video to record. */
export interface RecordOptions extends VideoOptions {
  /** Default: the best that the browser writes, WebM or MP4. */
  readonly mimeType?: string;
  /** Default: what the browser chooses. */
  readonly bitsPerSecond?: number;
  /** A CSS color behind the scene. Default: the background color of the element, else white. */
  readonly background?: string;
  /** Ends the recording: the video is what was recorded by then. */
  readonly signal?: AbortSignal;
}

/** Frames to draw one by one. */
export interface FrameOptions extends VideoOptions, ImageOptions {
  /** Number of frames, above `duration`. */
  readonly frames?: number;
}

export interface RecordingHost extends ImageHost {
  readonly camera: CameraController;
  readonly playback: PlaybackController;
  readonly behaviors: { rest(): void };
  readonly tour: Pick<Lazy<Tour>, 'get'>;
  readonly settled: Promise<unknown>;
  /** Called after each frame, in the task that has drawn it. */
  onFrame: (() => void) | undefined;
  requestFrame(): void;
}

const FRAME_RATE = 30;
/** Media types in order of preference. */
const TYPES = ['video/webm;codecs=vp9', 'video/webm', 'video/mp4'];

/** See `record()` of the element. */
export async function record(host: RecordingHost, options: RecordOptions): Promise<Blob> {
  const { frameRate = FRAME_RATE, bitsPerSecond, signal } = options;
  const mimeType = typeOf(options.mimeType);
  const path = await pathOf(host, options.path);
  const duration = options.duration ?? (path ? 1_000 * path.seconds : Infinity);
  if (duration === Infinity && !signal)
    throw new TypeError('record(): expected a path, a duration or a signal that ends the recording, found none');
  const { canvas } = host;
  if (!canvas || host.drawNow() === null) throw nothingToDraw();
  const { context, copy } = paperFor(host, canvas, options.background);
  // A stream begins with what the canvas has by then.
  copy();
  const recorder = new MediaRecorder(context.canvas.captureStream(frameRate), {
    mimeType,
    ...(bitsPerSecond && { videoBitsPerSecond: bitsPerSecond }),
  });
  const parts: Blob[] = [];
  recorder.addEventListener('dataavailable', ({ data }) => parts.push(data));
  const ended = new Promise<void>((resolve, reject) => {
    recorder.addEventListener('stop', () => resolve());
    recorder.addEventListener('error', () => reject(new DOMException('The recording failed', 'EncodingError')));
  });
  const before = host.camera.goal;
  host.onFrame = copy;
  recorder.start();
  try {
    await drive(host, path, duration, signal);
  } finally {
    host.onFrame = undefined;
    if (path) host.camera.moveTo(before);
    if (recorder.state !== 'inactive') recorder.stop();
  }
  await ended;
  for (const track of recorder.stream.getTracks()) track.stop();
  return new Blob(parts, { type: recorder.mimeType });
}

/** Draws frame after frame until the time is over. */
function drive(host: RecordingHost, path: CameraPath | null, duration: number, signal?: AbortSignal): Promise<void> {
  return new Promise((resolve) => {
    const start = performance.now();
    const end = (): void => {
      clearTimeout(timer);
      signal?.removeEventListener('abort', end);
      isOver = true;
      resolve();
    };
    let isOver = false;
    // A hidden page has no frames, and its video an end nevertheless.
    const timer = duration === Infinity ? undefined : setTimeout(end, duration);
    signal?.addEventListener('abort', end);
    if (signal?.aborted) end();
    const step = (): void => {
      if (isOver) return;
      if (path) {
        host.behaviors.rest();
        host.camera.moveTo(path.at(Math.min(1, (performance.now() - start) / duration)));
      }
      // Browsers record frames of a canvas that changes.
      host.requestFrame();
      requestAnimationFrame(step);
    };
    step();
  });
}

/** A canvas with a background that frames of the element are copied to: videos have no alpha, and one size. */
function paperFor(
  host: RecordingHost,
  { width, height }: HTMLCanvasElement,
  background: string | undefined,
): { context: CanvasRenderingContext2D; copy: () => void } {
  const own = getComputedStyle(host.element).backgroundColor;
  const color = background ?? (own === 'rgba(0, 0, 0, 0)' ? 'white' : own);
  if (!CSS.supports('color', color)) throw new TypeError(`record(): expected a CSS color, found "${color}"`);
  // Encoders halve both sides.
  const size = { width: width + (width % 2), height: height + (height % 2) };
  const context = Object.assign(document.createElement('canvas'), size).getContext('2d', { alpha: false })!;
  const copy = (): void => {
    const { canvas } = host;
    if (!canvas) return;
    context.fillStyle = color;
    context.fillRect(0, 0, size.width, size.height);
    context.drawImage(canvas, 0, 0, size.width, size.height);
  };
  return { context, copy };
}

function typeOf(asked: string | undefined): string {
  const isRecorded = (type: string): boolean =>
    typeof MediaRecorder !== 'undefined' && MediaRecorder.isTypeSupported(type);
  const type = asked === undefined ? TYPES.find(isRecorded) : isRecorded(asked) ? asked : undefined;
  if (type !== undefined) return type;
  const found = asked === undefined ? 'no MediaRecorder for video' : `none for ${asked}`;
  throw new DOMException(
    `record(): expected a browser that records ${asked ?? 'WebM or MP4'}, found ${found}; recordFrames() works in all`,
    'NotSupportedError',
  );
}

/** See `recordFrames()` of the element. */
export async function* recordFrames(host: RecordingHost, options: FrameOptions): AsyncGenerator<Blob, void> {
  const { path: name, duration, frameRate = FRAME_RATE, frames: count, ...image } = options;
  const { width, height } = image;
  const path = await pathOf(host, name, width && height ? width / height : undefined);
  const { camera, playback } = host;
  const seconds = duration === undefined ? (path?.seconds ?? playback.duration) : duration / 1_000;
  const frames = count ?? frameCount(seconds, frameRate);
  if (!(frames >= 1 && frames < Infinity))
    throw new TypeError('recordFrames(): expected a path, a duration or a number of frames, found none');
  const before = { goal: camera.goal, time: playback.currentTime, isPaused: playback.paused };
  if (!before.isPaused) playback.pause();
  try {
    for (const [frame, share] of frameShares(frames, path ?? { isClosed: false }).entries()) {
      host.behaviors.rest();
      if (path) camera.moveTo(path.at(share));
      if (playback.canPlay) await seek(host, Math.min(playback.duration, before.time + frame / frameRate));
      yield await takeImage(host, image);
    }
  } finally {
    if (path) camera.moveTo(before.goal);
    if (playback.canPlay) playback.currentTime = before.time;
    if (!before.isPaused) playback.play();
  }
}

/** Waits until the scene of a time is drawn. */
async function seek({ element, playback }: RecordingHost, seconds: number): Promise<void> {
  if (playback.currentTime === seconds) return;
  const shown = new Promise((resolve) => element.addEventListener('seeked', resolve, { once: true }));
  playback.currentTime = seconds;
  await shown;
}

/** null where the camera goes where it goes anyway. */
async function pathOf(host: RecordingHost, name: PathName | undefined, aspect?: number): Promise<CameraPath | null> {
  await host.settled;
  if (name === undefined) return null;
  const path = await (await host.tour.get()).path(name, aspect);
  if (path === null) throw new TypeError('Expected views to record a path along, found none: see the attribute views');
  return path;
}
