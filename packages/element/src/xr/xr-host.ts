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
import type { SpokenStrings } from '../words.js';

/** What VR, AR and the ruler ask of their element. */
export interface XrHost {
  readonly element: HTMLElement;
  readonly attributes: Attributes;
  readonly camera: CameraController;
  readonly surface: HTMLElement | null;
  readonly strings: SpokenStrings;
  readonly frame: ViewerFrame;
  readonly services: { readonly sceneLoader: SceneLoader };
  /** What the scene on show was asked for by; null while there is none, and for what no file has. */
  readonly walkable: SceneRequest | null;
  readonly sources: {
    readonly own: { readonly scene: { readonly scene: LoadedGaussians | null; readonly isOutgoing: boolean } };
  };
  readonly reveal: { dismiss(): void };
  readonly behaviours: { readonly announcer: Lazy<AnnouncerController> };
  readonly isOnShow: boolean;
  /** The camera of the last frame, in its pixels; undefined before there is one. */
  readonly drawnFrom: Camera | undefined;
  /** A session shows the scene: the page does not. */
  isImmersed: boolean;
  requestFrame(): void;
  positionFromPoint(clientX: number, clientY: number): Promise<ScenePoint | null>;
  warn(sentence: string): void;
}
