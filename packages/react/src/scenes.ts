'use client';
/**
 * Components for `<splat-scene>`, `<splat-mesh>` and `<splat-cut>`, the children of {@link GaussianSplat}, in React 18
 * and 19. Apps that do not import this module do not bundle it.
 */
import {
  SplatCutElement,
  SplatMeshElement,
  SplatSceneElement,
  type ChildEventMap,
  type SettableCutProperties,
  type SettableMeshProperties,
  type SettableSceneProperties,
} from '@gaussian-splat/element/scenes.js';
import { createComponent, type EventName } from '@lit/react';
import * as React from 'react';
import { assignedOnChange } from './assigned-on-change.js';

export type { SplatCutElement, SplatMeshElement, SplatSceneElement } from '@gaussian-splat/element/scenes.js';

const EVENTS = {
  onLoad: 'load',
  onProgress: 'progress',
  onPreview: 'preview',
  onError: 'error',
  onInputsChange: 'inputs-change',
  onGeneratorMemory: 'generator-memory',
  onGeneratorError: 'generator-error',
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
  onDurationChange: 'durationchange',
  onLoadedMetadata: 'loadedmetadata',
  onLoadStart: 'loadstart',
  onEmptied: 'emptied',
} as const satisfies Readonly<Record<`on${string}`, keyof ChildEventMap>>;

type ChildHandler = keyof typeof EVENTS;
type EventOf<Name extends ChildHandler> = ChildEventMap[(typeof EVENTS)[Name]];
type ChildListeners = { [Name in ChildHandler]?: (event: EventOf<Name>) => void };

/** Props of a child: the element's properties, handlers of its own events, React's common attributes, and `ref`. */
type ChildProps<E, Settable> = Omit<React.HTMLAttributes<E>, ChildHandler | keyof Settable> &
  ChildListeners &
  Settable &
  React.RefAttributes<E>;

export type SplatSceneProps = ChildProps<SplatSceneElement, SettableSceneProperties>;
export type SplatMeshProps = ChildProps<SplatMeshElement, SettableMeshProperties>;

/** Props that give a child a clock of its own, also if their value is equal. */
const CLOCK = ['currentTime', 'playbackRate'] as const;

const shared = { react: React, events: EVENTS as unknown as { [Name in ChildHandler]: EventName<EventOf<Name>> } };

/**
 * Component for `<splat-scene>`, a further scene of an element.
 *
 * ```tsx
 * <GaussianSplat src="room.sog" cameraControls>
 *   <SplatScene src="plant.spz" position={[1.2, 0, 0]} onError={({ detail }) => console.warn(detail.message)} />
 * </GaussianSplat>
 * ```
 */
export const SplatScene: React.ForwardRefExoticComponent<SplatSceneProps> = /* @__PURE__ */ assignedOnChange<
  SplatSceneElement,
  SplatSceneProps
>(
  /* @__PURE__ */ createComponent({
    ...shared,
    tagName: 'splat-scene',
    elementClass: SplatSceneElement,
    displayName: 'SplatScene',
  }),
  CLOCK,
);

/** Component for `<splat-mesh>`, a triangle mesh: `<SplatMesh src="chair.glb" autoplay loop />`. */
export const SplatMesh: React.ForwardRefExoticComponent<SplatMeshProps> = /* @__PURE__ */ assignedOnChange<
  SplatMeshElement,
  SplatMeshProps
>(
  /* @__PURE__ */ createComponent({
    ...shared,
    tagName: 'splat-mesh',
    elementClass: SplatMeshElement,
    displayName: 'SplatMesh',
  }),
  CLOCK,
);

export type SplatCutProps = Omit<React.HTMLAttributes<SplatCutElement>, keyof SettableCutProperties> &
  SettableCutProperties &
  React.RefAttributes<SplatCutElement>;

/**
 * Component for `<splat-cut>`, which hides or changes splats in a region: `<SplatCut shape="plane" position={[0, 0.8,
 * 0]} />`.
 */
export const SplatCut: React.ForwardRefExoticComponent<SplatCutProps> = /* @__PURE__ */ createComponent({
  react: React,
  events: {},
  tagName: 'splat-cut',
  elementClass: SplatCutElement,
  displayName: 'SplatCut',
});
