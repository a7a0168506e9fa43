/** Videos: recorded by the browser in real time, or drawn frame by frame as images. */
import { nothingToDraw, takeImage, type ImageOptions } from './capture-image.js';
import { frameCount, frameShares, type CameraPath, type PathName } from '../../viewer/camera/camera-path.js';
import type { Viewer } from '../../viewer/viewer.js';

/** Path, duration and frame rate of a video. */
interface VideoOptions {
  /**
   * Path of the camera: through the list of `views`, or once around the target. Default: the camera of the element,
   * which visitors may move.
   */
  readonly path?: PathName;
  /** Duration in milliseconds. Default: the duration of the path. */
  readonly duration?: number;
  /** Frames per second. Default 30. */
  readonly frameRate?: number;
}

/** Options of `record()`. */
export interface RecordOptions extends VideoOptions {
  /** Media type of the video. Default: the first of WebM with VP9, WebM and MP4 that the browser can write. */
  readonly mimeType?: string;
  /** Bit rate of the video, bits per second. Default: the browser's. */
  readonly bitsPerSecond?: number;
  /** CSS color behind the scene. Default: the background color of the element, or white if that is transparent. */
  readonly background?: string;
  /** Signal that ends the recording. The video then contains what was recorded until then. */
  readonly signal?: AbortSignal;
}

/** Options of `recordFrames()`. */
export interface FrameOptions extends VideoOptions, ImageOptions {
  /** Number of frames; takes precedence over `duration`. */
  readonly frames?: number;
}

/** The part of the list of views that has the paths. */
interface Paths {
  path(name: PathName, aspect?: number): Promise<CameraPath | null>;
}

const FRAME_RATE = 30;
/** Media types in order of preference. */
const TYPES = ['video/webm;codecs=vp9', 'video/webm', 'video/mp4'];

/** Elements that are recorded. Two recordings would move the same camera, seek the same clock, and share a canvas. */
const recorded = new WeakSet<HTMLElement>();

/**
 * Reserves an element for one recording, until the returned function is called.
 * @throws DOMException `InvalidStateError` during another recording of the element
 */
function reserve({ element }: Viewer, method: string): () => void {
  if (recorded.has(element))
    throw new DOMException(
      `${method}: expected no other recording of this element, found one; wait until it ends, or end it by its signal or by return()`,
      'InvalidStateError',
    );
  recorded.add(element);
  return () => recorded.delete(element);
}

/** Records a video in real time: see `record()` of the element. */
export async function record(host: Viewer, options: RecordOptions): Promise<Blob> {
  const { frameRate = FRAME_RATE, bitsPerSecond, signal } = options;
  const mimeType = typeOf(options.mimeType);
  const path = await pathOf(host, options.path);
  const duration = options.duration ?? (path ? 1_000 * path.seconds : Infinity);
  if (duration === Infinity && !signal)
    throw new TypeError('record(): expected a path, a duration or a signal that ends the recording, found none');
  const { canvas } = host;
  if (!canvas || host.drawNow() === null) throw nothingToDraw();
  const { context, copy } = paperFor(host, canvas, options.background);
  // The stream begins with the current content of its canvas.
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
  const release = reserve(host, 'record()');
  const before = host.camera.goal;
  host.onFrame = copy;
  try {
    recorder.start();
    await drive(host, path, duration, signal);
  } finally {
    release();
    host.onFrame = undefined;
    if (path) host.camera.moveTo(before);
    if (recorder.state !== 'inactive') recorder.stop();
  }
  await ended;
  for (const track of recorder.stream.getTracks()) track.stop();
  return new Blob(parts, { type: recorder.mimeType });
}

/** Requests frames, and moves the camera along `path`, for `duration` milliseconds or until the signal is aborted. */
function drive(host: Viewer, path: CameraPath | null, duration: number, signal?: AbortSignal): Promise<void> {
  return new Promise((resolve) => {
    const start = performance.now();
    const end = (): void => {
      clearTimeout(timer);
      signal?.removeEventListener('abort', end);
      isOver = true;
      resolve();
    };
    let isOver = false;
    // The end is a timer, because a hidden page has no frames.
    const timer = duration === Infinity ? undefined : setTimeout(end, duration);
    signal?.addEventListener('abort', end);
    if (signal?.aborted) end();
    const step = (): void => {
      if (isOver) return;
      if (path) {
        host.rest();
        host.camera.moveTo(path.at(Math.min(1, (performance.now() - start) / duration)));
      }
      // Browsers add a frame to the video only if the canvas changes.
      host.requestFrame();
      requestAnimationFrame(step);
    };
    step();
  });
}

/**
 * Creates a canvas with a background, and a function that copies the element's image to it. Videos have no alpha and a
 * constant size.
 */
function paperFor(
  host: Viewer,
  { width, height }: HTMLCanvasElement,
  background: string | undefined,
): { context: CanvasRenderingContext2D; copy: () => void } {
  const own = getComputedStyle(host.element).backgroundColor;
  const color = background ?? (own === 'rgba(0, 0, 0, 0)' ? 'white' : own);
  if (!CSS.supports('color', color)) throw new TypeError(`record(): expected a CSS color, found "${color}"`);
  // Encoders need even sides, because they store color at half resolution.
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

/** Yields the images of a video one by one: see `recordFrames()` of the element. */
export async function* recordFrames(host: Viewer, options: FrameOptions): AsyncGenerator<Blob, void> {
  const { path: name, duration, frameRate = FRAME_RATE, frames: count, ...image } = options;
  const { width, height } = image;
  const path = await pathOf(host, name, width && height ? width / height : undefined);
  const { camera, playback } = host;
  const seconds = duration === undefined ? (path?.seconds ?? playback.duration) : duration / 1_000;
  const frames = count ?? frameCount(seconds, frameRate);
  if (!(frames >= 1 && frames < Infinity))
    throw new TypeError('recordFrames(): expected a path, a duration or a number of frames, found none');
  const release = reserve(host, 'recordFrames()');
  const before = { goal: camera.goal, time: playback.currentTime, isPaused: playback.paused };
  if (!before.isPaused) playback.pause();
  try {
    for (const [frame, share] of frameShares(frames, path ?? { isClosed: false }).entries()) {
      host.rest();
      if (path) camera.moveTo(path.at(share));
      if (playback.canPlay) await seek(host, Math.min(playback.duration, before.time + frame / frameRate));
      yield await takeImage(host, image);
    }
  } finally {
    release();
    if (path) camera.moveTo(before.goal);
    if (playback.canPlay) {
      playback.currentTime = before.time;
      if (!before.isPaused) playback.play();
    }
  }
}

/** Seeks to a time in seconds, and waits until its frame is drawn. Rejects if the scene is removed or replaced. */
async function seek({ element, playback }: Viewer, seconds: number): Promise<void> {
  if (playback.currentTime === seconds) return;
  const over = new AbortController();
  const { signal } = over;
  const shown = new Promise((resolve, reject) => {
    element.addEventListener('seeked', resolve, { signal });
    element.addEventListener('emptied', () => reject(nothingToDraw()), { signal });
  });
  playback.currentTime = seconds;
  await shown.finally(() => over.abort());
}

/**
 * Returns a path by name after the scene has loaded; null without a name.
 * @param aspect width by height; default: that of the element
 * @throws TypeError if the page has no views
 */
async function pathOf(host: Viewer, name: PathName | undefined, aspect?: number): Promise<CameraPath | null> {
  await host.settled;
  if (name === undefined) return null;
  const path = await (await host.features.get<Paths>('views').get()).path(name, aspect);
  if (path === null) throw new TypeError('Expected views as a path to record, found none: see the attribute views');
  return path;
}
