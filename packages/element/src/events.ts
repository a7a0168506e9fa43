import type { GaussianSplatError } from '@gaussian-splat/core';
import type { ScenePoint } from './camera/values.js';
import type { ElementError } from './errors.js';

/**
 * Who moved the camera: a person, the element itself (framing a scene or a new size), or the page's own code
 * (attributes and methods).
 */
export type CameraChangeSource = 'user-interaction' | 'automatic' | 'none';

export interface CameraChangeDetail {
  readonly source: CameraChangeSource;
}

export interface ViewChangeDetail {
  /** The view's name. */
  readonly name: string;
  /** Its place in the list, from 0. */
  readonly index: number;
}

export interface WalkReadyDetail {
  /** Area of the floor, m². */
  readonly area: number;
}

export interface ImmersiveStatusDetail {
  readonly status: 'not-presenting' | 'session-started' | 'object-placed' | 'failed';
  /** Why it failed. */
  readonly reason?: string;
}

export interface MeasureDetail {
  /** Ends of the ruler, viewer space. */
  readonly from: ScenePoint;
  readonly to: ScenePoint;
  /** In units of the scene. */
  readonly length: number;
  /** What the length may be off by, in units of the scene. */
  readonly uncertainty: number;
  /** The length in meters; null unless the attribute `unit` says how long a unit is. */
  readonly meters: number | null;
  /** Meters of a unit, where that is known. */
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
  /** Why the generator does not run on the GPU, for readers. */
  readonly reason: string;
}

export interface PreviewDetail {
  /** Splats shown. */
  readonly splats: number;
}

/** `detail` of the event `hotspot-visibility`, which is fired on a hotspot itself. */
export interface HotspotVisibilityDetail {
  /** Whether a visitor can see the hotspot's point: it is before the camera, faces it, and nothing hides it. */
  readonly visible: boolean;
}

/** Events of `<gaussian-splat>`. None of them bubbles. */
export interface GaussianSplatEventMap {
  /** The scene's first frame is on the screen. */
  load: CustomEvent<LoadDetail>;
  /** Bytes have arrived. The first and the last event of a load always fire. */
  progress: ProgressEvent;
  /** A part of the scene is shown while the rest of it loads: fewer splats, or splats without their view-dependent colours. */
  preview: CustomEvent<PreviewDetail>;
  /** The function of `splatShader` does not compile; `detail` names the line. The scene is drawn without it. */
  'shader-error': CustomEvent<GaussianSplatError>;
  /** The scene cannot be shown; the same object as `element.error`. */
  error: CustomEvent<ElementError>;
  /** The camera has moved; at most once a frame. */
  'camera-change': CustomEvent<CameraChangeDetail>;
  /** The camera sets out for a view of the list. */
  'view-change': CustomEvent<ViewChangeDetail>;
  /** Fired when the floor of `navigation="walk"` is known and the camera stands on it. */
  'walk-ready': CustomEvent<WalkReadyDetail>;
  /** VR can be started, has started, is over, or failed. */
  'vr-status': CustomEvent<ImmersiveStatusDetail>;
  /** The same for AR; the object stands in the room. */
  'ar-status': CustomEvent<ImmersiveStatusDetail>;
  /** A visitor has measured a length. */
  measure: CustomEvent<MeasureDetail>;
  /** The poster has given way to the scene. */
  'poster-dismissed': Event;
  /** The element has come into sight, or left it. */
  'model-visibility': CustomEvent<VisibilityDetail>;
  /** A run of the generator failed; the last good frame stays, and the next change tries again. */
  'generator-error': CustomEvent<ElementError>;
  /** The inputs that the page may set are others: see the property `inputs`. */
  'inputs-change': Event;
  /** The generator runs on the CPU, because of the reason given. */
  'generator-fallback': CustomEvent<FallbackDetail>;
  /** Loading and time, as of HTMLMediaElement. */
  play: Event;
  playing: Event;
  /** A clip has to wait for what comes next; `playing` follows. */
  waiting: Event;
  pause: Event;
  timeupdate: Event;
  seeking: Event;
  seeked: Event;
  ended: Event;
  ratechange: Event;
  /** The sound of the scene is louder, quieter, muted or another one. */
  volumechange: Event;
  durationchange: Event;
  loadedmetadata: Event;
  loadstart: Event;
  loadeddata: Event;
  canplay: Event;
  emptied: Event;
  /** The GPU device was lost. The element recovers by itself. */
  contextlost: Event;
  /** The frame is back after a loss. */
  contextrestored: Event;
}

declare global {
  interface HTMLElementEventMap {
    /** A hotspot of a `<gaussian-splat>` has come into sight, or is hidden now. */
    'hotspot-visibility': CustomEvent<HotspotVisibilityDetail>;
  }
}
