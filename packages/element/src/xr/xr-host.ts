import type { Camera } from '@gaussian-splat/core';
import type { Attributes } from '../attributes.js';
import type { ViewerFrame } from '../camera/orbit.js';
import type { ScenePoint } from '../camera/values.js';
import type { AnnouncerController } from '../controllers/announcer-controller.js';
import type { CameraController } from '../controllers/camera-controller.js';
import type { LoadedGaussians } from '../gpu/loaded-gaussians.js';
import type { Lazy } from '../lazy.js';
import type { SceneRequest } from '../loading/protocol.js';
import type { SceneLoader } from '../loading/scene-loader.js';
import type { A11yStrings } from '../words.js';

/** The interface of the element that VR, AR and the ruler use. */
export interface XrHost {
  readonly element: HTMLElement;
  readonly attributes: Attributes;
  readonly camera: CameraController;
  readonly surface: HTMLElement | null;
  readonly strings: A11yStrings;
  readonly frame: ViewerFrame;
  readonly services: { readonly sceneLoader: SceneLoader };
  /** The request of the displayed scene; null without one, and for sources without a file. */
  readonly walkable: SceneRequest | null;
  readonly sources: {
    readonly ownEntry: { readonly scene: { readonly scene: LoadedGaussians | null; readonly isOutgoing: boolean } };
  };
  readonly reveal: { dismiss(): void };
  readonly behaviors: { readonly announcer: Lazy<AnnouncerController> };
  readonly isOnShow: boolean;
  /** The camera of the last frame, in its pixels; undefined before there is one. */
  readonly drawnFrom: Camera | undefined;
  /** A session shows the scene, so the page does not draw it. */
  isImmersed: boolean;
  requestFrame(): void;
  positionFromPoint(clientX: number, clientY: number): Promise<ScenePoint | null>;
  warn(sentence: string): void;
}
