import type { GaussianSplatEventMap } from '@gaussian-splat/element';
import type { EventName } from '@lit/react';

/** Event type for each handler. A handler has React's own name for the event if there is one. */
const EVENTS = {
  onLoad: 'load',
  onProgress: 'progress',
  onPreview: 'preview',
  onError: 'error',
  onShaderError: 'shader-error',
  onCameraChange: 'camera-change',
  onPosterDismissed: 'poster-dismissed',
  onInputsChange: 'inputs-change',
  onViewChange: 'view-change',
  onWalkReady: 'walk-ready',
  onVrStatus: 'vr-status',
  onArStatus: 'ar-status',
  onMeasure: 'measure',
  onModelVisibility: 'model-visibility',
  onCreditsChange: 'credits-change',
  onRoomChange: 'room-change',
  onGeneratorError: 'generator-error',
  onGeneratorMemory: 'generator-memory',
  onGeneratorFallback: 'generator-fallback',
  onPlay: 'play',
  onPlaying: 'playing',
  onWaiting: 'waiting',
  onPause: 'pause',
  onTimeUpdate: 'timeupdate',
  onSeeking: 'seeking',
  onSeeked: 'seeked',
  onEnded: 'ended',
  onRateChange: 'ratechange',
  onVolumeChange: 'volumechange',
  onDurationChange: 'durationchange',
  onLoadedMetadata: 'loadedmetadata',
  onLoadStart: 'loadstart',
  onLoadedData: 'loadeddata',
  onCanPlay: 'canplay',
  onCanPlayThrough: 'canplaythrough',
  onEmptied: 'emptied',
  onContextLost: 'contextlost',
  onContextRestored: 'contextrestored',
} as const satisfies Readonly<Record<`on${string}`, keyof GaussianSplatEventMap>>;

/** Name of a handler, such as `onTimeUpdate`. */
export type HandlerName = keyof typeof EVENTS;

type EventOf<Name extends HandlerName> = GaussianSplatEventMap[(typeof EVENTS)[Name]];

/** Type of the handlers for `createComponent` of `@lit/react`. */
export type Handlers = { readonly [Name in HandlerName]: EventName<EventOf<Name>> };

/** Handlers as props of apps, each with the type of its event. */
export type Listeners = { [Name in HandlerName]?: (event: EventOf<Name>) => void };

/**
 * Handlers that listen to the element directly. React reserves `onLoad`, `onError`, `onTimeUpdate`, `onPlay` and
 * similar names on custom elements, but never calls them.
 */
export const HANDLERS = EVENTS as unknown as Handlers;
