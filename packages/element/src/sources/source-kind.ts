import type { LoadedGaussians } from '../gpu/loaded-gaussians.js';
import type { DeviceLease, SharedDevice } from '../gpu/shared-device.js';
import type {
  LoadedScene,
  LoadedSequence,
  PartTaker,
  ProgressListener,
  SceneRequest,
  SentScene,
  TaskListeners,
} from '../loading/protocol.js';
import type { SceneLoader } from '../loading/scene-loader.js';
import type { SourceKindName } from './content.js';
import type { DynamicRequest } from './generator/dynamic-model.js';

/** A kind of source: a row of `SOURCE_KINDS`. */
export interface SourceKind {
  readonly name: SourceKindName;
  /**
   * Returns a truthy value if a request is for a source of this kind.
   * @param found Manifest that the file of the request turned out to be; undefined before it is read.
   */
  matches(request: SceneRequest, found: LoadedSequence | undefined): unknown;
  /** Imports the code that opens sources of this kind. */
  load(): Promise<{ readonly open: OpenSource }>;
}

/**
 * Opens a source of a kind: see `openSource`. Returns the manifest instead, if the file of the request turned out to be
 * one.
 */
export type OpenSource = (
  request: SceneRequest,
  options: OpenOptions,
  acquiring: Promise<DeviceLease>,
  found: LoadedSequence | undefined,
) => Promise<LoadedGaussians | LoadedSequence>;

/** The load of a file that was requested together with a device, and that WebGL continues if there is none. */
export interface BegunLoad {
  readonly loading: Promise<LoadedScene | SentScene | LoadedSequence>;
  /** Listeners of the load, which may be replaced. */
  readonly listeners: Partial<Pick<TaskListeners, 'onPreview' | 'onPart'>>;
  readonly abort: AbortController;
  /** Gives the parts of the scene, which have waited for the code of WebGL, to it. Call once. */
  readonly take: (add: PartTaker) => void;
}

/** Services and settings for opening a source, and functions that are called meanwhile. */
export interface OpenOptions {
  readonly device: SharedDevice;
  readonly loader: SceneLoader;
  readonly signal: AbortSignal;
  /** Returns the address from which a frame of a sequence is fetched, as the page rewrites it. */
  readonly frameUrl: (url: string) => string;
  readonly onProgress: ProgressListener;
  /**
   * Called with a preview of a scene that is still loading. The callee owns the preview. Absent if no previews are
   * wanted.
   */
  readonly onPreview?: (preview: LoadedGaussians) => void;
  /**
   * Called with the GPU memory of the new scene, in bytes, just before its upload. The callee can free the old scene,
   * so that both never coexist.
   */
  readonly beforeUpload: (byteLength: number) => void;
  /** Maximum GPU memory of the scene, in bytes; undefined if only the device limits it. */
  readonly memoryBudget: number | undefined;
  /** Number of submissions into which the work of a frame is divided. */
  readonly submissions: number;
  /** Number of devices that were lost in a row before the first frame, perhaps for lack of memory. */
  readonly losses: number;
  /** The load that WebGL continues, so that the file is not fetched again. */
  readonly begun: { load?: BegunLoad };
  /** Returns additional parameters for opening a generator. */
  readonly live: () => Omit<DynamicRequest, 'url' | 'chain' | 'contract' | 'credentials' | 'memoryBudget'>;
}
