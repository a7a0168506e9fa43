import type { ElementError } from './errors.js';

/**
 * Cause of a camera move: a visitor, the element itself (`automatic`: a new scene or size), or the page's attributes
 * and methods (`none`).
 */
export type CameraChangeSource = 'user-interaction' | 'automatic' | 'none';

export interface CameraChangeDetail {
  readonly source: CameraChangeSource;
}

export interface LoadDetail {
  /** Absolute URL of the scene. */
  readonly url: string;
}

export interface VisibilityDetail {
  /** Whether any part of the element is in the viewport. */
  readonly visible: boolean;
}

export interface FallbackDetail {
  /** Reason that the generator does not run on the GPU, in English. */
  readonly reason: string;
}

/** Memory of a generator, as far as it is known before the first run. A run needs more. */
export interface GeneratorMemoryDetail {
  /** Bytes of all weights and constants of its models. */
  readonly weightBytes: number;
  /**
   * Bytes of the largest computed tensor among those of known size; null if no size is known. Other tensors may be
   * larger if `unknownTensors` is not 0.
   */
  readonly largestKnownTensorBytes: number | null;
  /** Number of computed tensors whose size only a run determines. */
  readonly unknownTensors: number;
  /** Bytes of GPU memory that is already reserved for the generator's Gaussians. */
  readonly gaussianBytes: number;
}

export interface PreviewDetail {
  /** Number of splats that are shown. */
  readonly splats: number;
}

/** `detail` of the event `hotspot-visibility`, which is fired on a hotspot itself. */
export interface HotspotVisibilityDetail {
  /** Whether the hotspot's point is visible: in front of the camera, facing it, and not occluded. */
  readonly visible: boolean;
}

/** Events of `<gaussian-splat>`. None of these events bubbles. */
export interface GaussianSplatEventMap {
  /** Fired when the scene's first frame is on the screen. */
  load: CustomEvent<LoadDetail>;
  /** Fired when bytes have arrived. The first and the last event of a load always fire. */
  progress: ProgressEvent;
  /**
   * Fired when a part of the scene is shown while the rest of it loads: fewer splats, or splats without their
   * view-dependent colors.
   */
  preview: CustomEvent<PreviewDetail>;
  /** Fired when the scene cannot be shown; `detail` is the same object as `element.error`. */
  error: CustomEvent<ElementError>;
  /** Fired when the camera has moved; at most once in each frame. */
  'camera-change': CustomEvent<CameraChangeDetail>;
  /** Fired when the poster is dismissed and the scene becomes visible. */
  'poster-dismissed': Event;
  /** Fired when the element enters or leaves the viewport. */
  'model-visibility': CustomEvent<VisibilityDetail>;
  /** Fired when a run of the generator fails; the last good frame stays, and the next change tries again. */
  'generator-error': CustomEvent<ElementError>;
  /** Fired when the list of generator inputs that the page may set changes: see the property `inputs`. */
  'inputs-change': Event;
  /** Fired once before the first run of a generator, with the memory that is known before it runs. */
  'generator-memory': CustomEvent<GeneratorMemoryDetail>;
  /** Fired when the generator runs on the CPU, with the reason. */
  'generator-fallback': CustomEvent<FallbackDetail>;
  /** This event and the following ones of loading and playback have the same meaning as on HTMLMediaElement. */
  play: Event;
  playing: Event;
  /** Fired when a clip waits for its next frames; `playing` follows. */
  waiting: Event;
  pause: Event;
  timeupdate: Event;
  seeking: Event;
  seeked: Event;
  ended: Event;
  ratechange: Event;
  /** Fired when the sound of the scene becomes louder, quieter, muted or is replaced. */
  volumechange: Event;
  durationchange: Event;
  loadedmetadata: Event;
  loadstart: Event;
  loadeddata: Event;
  canplay: Event;
  canplaythrough: Event;
  emptied: Event;
  /** Fired when the GPU device is lost. The element recovers automatically. */
  contextlost: Event;
  /** Fired when the frame is restored after a loss. */
  contextrestored: Event;
}

declare global {
  interface HTMLElementEventMap {
    /** Fired when a hotspot of a `<gaussian-splat>` becomes visible or hidden. */
    'hotspot-visibility': CustomEvent<HotspotVisibilityDetail>;
  }
}
