import type { GaussianSplatError } from '@gaussian-splat/core';
import type { ScenePoint } from './camera/values.js';
import type { ElementError } from './errors.js';

/**
 * Source of a camera move: a visitor, the element itself (framing a scene or a new size), or the page's own code
 * (attributes and methods).
 */
export type CameraChangeSource = 'user-interaction' | 'automatic' | 'none';

export interface CameraChangeDetail {
  readonly source: CameraChangeSource;
}

export interface ViewChangeDetail {
  /** The view's name. */
  readonly name: string;
  /** Its index in the list, from 0. */
  readonly index: number;
}

export interface WalkReadyDetail {
  /** Area of the floor, m². */
  readonly area: number;
}

export interface ImmersiveStatusDetail {
  readonly status: 'not-presenting' | 'session-started' | 'object-placed' | 'failed';
  /** Reason of a failure. */
  readonly reason?: string;
}

export interface MeasureDetail {
  /** Ends of the ruler in viewer space. */
  readonly from: ScenePoint;
  readonly to: ScenePoint;
  /** Length in units of the scene. */
  readonly length: number;
  /** Uncertainty of the length, in units of the scene. */
  readonly uncertainty: number;
  /** The length in meters; null unless the attribute `unit` defines the unit. */
  readonly meters: number | null;
  /** Meters per unit; null if unknown. */
  readonly unit: number | null;
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
  /** Reason that the generator does not run on the GPU, for display. */
  readonly reason: string;
}

/** Memory of a generator that is known before its first run. A run takes more. */
export interface GeneratorMemoryDetail {
  /** Bytes of all weights and constants of its models. */
  readonly weightBytes: number;
  /**
   * Bytes of the largest tensor that the nodes compute, among those of known size: a lower bound while `unknownTensors` is
   * not 0. null if no size is known.
   */
  readonly largestKnownTensorBytes: number | null;
  /** Number of computed tensors whose size only a run determines. */
  readonly unknownTensors: number;
  /** Bytes of GPU memory of its Gaussians, which are reserved already. */
  readonly gaussianBytes: number;
}

export interface PreviewDetail {
  /** Splats shown. */
  readonly splats: number;
}

/** `detail` of the event `hotspot-visibility`, which is fired on a hotspot itself. */
export interface HotspotVisibilityDetail {
  /** Whether the hotspot's point is visible: in front of the camera, facing it, and not occluded. */
  readonly visible: boolean;
}

/** Events of `<gaussian-splat>`. None of them bubbles. */
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
  /** Fired when the hook of `splatShader` does not compile; `detail` names the line. The scene is drawn without it. */
  'shader-error': CustomEvent<GaussianSplatError>;
  /** Fired when the scene cannot be shown; `detail` is the same object as `element.error`. */
  error: CustomEvent<ElementError>;
  /** Fired when the camera has moved; at most once in each frame. */
  'camera-change': CustomEvent<CameraChangeDetail>;
  /** Fired when the camera starts moving to a view of the list. */
  'view-change': CustomEvent<ViewChangeDetail>;
  /** Fired when the floor of `navigation="walk"` is known and the camera stands on it. */
  'walk-ready': CustomEvent<WalkReadyDetail>;
  /** Fired when VR can be started, has started, has ended, or failed. */
  'vr-status': CustomEvent<ImmersiveStatusDetail>;
  /** The same for AR; the object is placed in the real environment. */
  'ar-status': CustomEvent<ImmersiveStatusDetail>;
  /** Fired when a visitor has measured a length. */
  measure: CustomEvent<MeasureDetail>;
  /** Fired when the poster is dismissed and the scene becomes visible. */
  'poster-dismissed': Event;
  /** Fired when the element enters or leaves the viewport. */
  'model-visibility': CustomEvent<VisibilityDetail>;
  /** Fired when a run of the generator fails; the last good frame stays, and the next change tries again. */
  'generator-error': CustomEvent<ElementError>;
  /** Fired when the inputs that the page may set change: see the property `inputs`. */
  'inputs-change': Event;
  /** Fired once before the first run of a generator, with the memory that is known by then. */
  'generator-memory': CustomEvent<GeneratorMemoryDetail>;
  /** Fired when the generator runs on the CPU, with the reason. */
  'generator-fallback': CustomEvent<FallbackDetail>;
  /** Loading and playback, same as on HTMLMediaElement. */
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
