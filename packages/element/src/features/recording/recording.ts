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
/** Maximum wait for a frame of the page, ms, because hidden pages have none. */
const FRAME_MS = 250;
/** Time for encoding the last frame of a video, ms. */
const TAIL_MS = 250;
/** Maximum wait for the audio output, ms. It does not start before the visitor interacts with the page. */
const AUDIO_START_MS = 500;

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
  const { context, copy, renew } = paperFor(host, canvas, options.background);
  // The stream begins with the current content of its canvas.
  copy();
  const release = reserve(host, 'record()');
  const before = host.camera.goal;
  const sound = await soundOf(host.element);
  const tracks = [...context.canvas.captureStream(frameRate).getTracks(), ...sound.tracks];
  try {
    const recorder = new MediaRecorder(new MediaStream(tracks), {
      mimeType,
      ...(bitsPerSecond && { videoBitsPerSecond: bitsPerSecond }),
    });
    const video = contentOf(recorder);
    host.onFrame = copy;
    recorder.start();
    // The video begins with its first frame and ends with its last one, whenever the scene draws others.
    const start = performance.now();
    await addFrame(renew);
    await drive(host, { path, start, duration, signal, renew });
    for (const track of sound.tracks) track.stop();
    await addFrame(renew);
    // The recorder drops frames that it has not encoded yet.
    await new Promise((resolve) => setTimeout(resolve, TAIL_MS));
    if (recorder.state !== 'inactive') recorder.stop();
    return await video;
  } finally {
    release();
    host.onFrame = undefined;
    if (path) host.camera.moveTo(before);
    for (const track of tracks) track.stop();
    sound.close();
  }
}

/** Resolves with the video when a recorder stops. */
function contentOf(recorder: MediaRecorder): Promise<Blob> {
  const parts: Blob[] = [];
  recorder.addEventListener('dataavailable', ({ data }) => parts.push(data));
  const content = new Promise<Blob>((resolve, reject) => {
    recorder.addEventListener('stop', () => resolve(new Blob(parts, { type: recorder.mimeType })));
    recorder.addEventListener('error', () => reject(new DOMException('The recording failed', 'EncodingError')));
  });
  content.catch(() => undefined);
  return content;
}

/** Parameters of {@link drive}. Times in milliseconds; `start` is that of the first frame. */
interface Drive {
  readonly path: CameraPath | null;
  readonly start: number;
  readonly duration: number;
  readonly signal: AbortSignal | undefined;
  readonly renew: () => void;
}

/**
 * Requests frames, and moves the camera along `path`, until `duration` milliseconds after the start or until the signal is
 * aborted.
 */
function drive(host: Viewer, { path, start, duration, signal, renew }: Drive): Promise<void> {
  return new Promise((resolve) => {
    const end = (): void => {
      clearTimeout(timer);
      signal?.removeEventListener('abort', end);
      isOver = true;
      resolve();
    };
    let isOver = false;
    // The end is a timer, because a hidden page has no frames.
    const timer = duration === Infinity ? undefined : setTimeout(end, start + duration - performance.now());
    signal?.addEventListener('abort', end);
    if (signal?.aborted) end();
    const step = (): void => {
      if (isOver) return;
      if (path) {
        host.rest();
        host.camera.moveTo(path.at(Math.min(1, (performance.now() - start) / duration)));
      }
      // A scene that takes longer for a frame than the video has its last frame several times.
      renew();
      host.requestFrame();
      requestAnimationFrame(step);
    };
    step();
  });
}

/** Adds a frame to the video, and waits until the stream has it. */
async function addFrame(renew: () => void): Promise<void> {
  renew();
  await Promise.race([new Promise(requestAnimationFrame), new Promise((resolve) => setTimeout(resolve, FRAME_MS))]);
  await new Promise((resolve) => setTimeout(resolve));
}

/** Audio tracks of a recording. `close` frees them. */
interface RecordedSound {
  readonly tracks: readonly MediaStreamTrack[];
  close(): void;
}

const SILENT: RecordedSound = { tracks: [], close: () => undefined };

/**
 * Returns the sound of the child with `slot="sound"`, at full volume. There is none if the browser cannot capture it, or
 * does not allow the page to play sound yet.
 */
async function soundOf(element: HTMLElement): Promise<RecordedSound> {
  const child: (HTMLMediaElement & { captureStream?(): MediaStream }) | null = element.querySelector(
    ':scope > :is(audio, video)[slot=sound]',
  );
  if (!child?.captureStream) return SILENT;
  // Without this context, a sound that rests would keep the recorder waiting.
  const context = new AudioContext();
  const close = (): void => void context.close().catch(() => undefined);
  await Promise.race([context.resume(), new Promise((resolve) => setTimeout(resolve, AUDIO_START_MS))]);
  if (context.state !== 'running') {
    close();
    return SILENT;
  }
  try {
    const output = context.createMediaStreamDestination();
    const captured = child.captureStream();
    const connect = (): void => {
      const [track] = captured.getAudioTracks();
      if (track) context.createMediaStreamSource(new MediaStream([track])).connect(output);
    };
    connect();
    captured.addEventListener('addtrack', connect);
    return { tracks: output.stream.getAudioTracks(), close };
  } catch (error) {
    console.warn(
      `record(): expected a sound that the page may read, found ${(error as Error).message}; set crossorigin on the element with slot="sound"`,
    );
    close();
    return SILENT;
  }
}

/**
 * Creates a canvas with a background, a function that copies the element's image to it, and one that makes it a new frame
 * without a change. Videos have no alpha and a constant size.
 */
function paperFor(
  host: Viewer,
  { width, height }: HTMLCanvasElement,
  background: string | undefined,
): { context: CanvasRenderingContext2D; copy: () => void; renew: () => void } {
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
  // Browsers add a frame to the video only if something is drawn on the canvas.
  const renew = (): void => context.drawImage(context.canvas, 0, 0, 1, 1, 0, 0, 1, 1);
  return { context, copy, renew };
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
