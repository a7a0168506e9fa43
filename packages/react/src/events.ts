import type { GaussianSplatEventMap } from '@gaussian-splat/element';
import type { EventName } from '@lit/react';

/** `camera-change` as React names its handlers: `onCameraChange`. */
type HandlerName<Type extends string> = Type extends `${infer Head}-${infer Tail}`
  ? `${Capitalize<Head>}${Capitalize<Tail>}`
  : Capitalize<Type>;

/** A handler for every event of the element, each with that event's type. */
export type Handlers = {
  readonly [Type in string & keyof GaussianSplatEventMap as `on${HandlerName<Type>}`]: EventName<
    GaussianSplatEventMap[Type]
  >;
};

const event = <Type extends string & keyof GaussianSplatEventMap>(type: Type): EventName<GaussianSplatEventMap[Type]> =>
  type as unknown as EventName<GaussianSplatEventMap[Type]>;

/**
 * Which event a handler is for. React keeps `onLoad`, `onError`, `onProgress`, `onPlay` and their like to itself on custom elements; a handler
 * here listens to the element.
 */
export const HANDLERS: Handlers = {
  onLoad: event('load'),
  onProgress: event('progress'),
  onPreview: event('preview'),
  onError: event('error'),
  onCameraChange: event('camera-change'),
  onPosterDismissed: event('poster-dismissed'),
  onModelVisibility: event('model-visibility'),
  onGeneratorError: event('generator-error'),
  onGeneratorFallback: event('generator-fallback'),
  onPlay: event('play'),
  onPlaying: event('playing'),
  onPause: event('pause'),
  onTimeupdate: event('timeupdate'),
  onSeeking: event('seeking'),
  onSeeked: event('seeked'),
  onEnded: event('ended'),
  onRatechange: event('ratechange'),
  onDurationchange: event('durationchange'),
  onLoadedmetadata: event('loadedmetadata'),
  onLoadstart: event('loadstart'),
  onLoadeddata: event('loadeddata'),
  onCanplay: event('canplay'),
  onEmptied: event('emptied'),
  onContextlost: event('contextlost'),
  onContextrestored: event('contextrestored'),
};
