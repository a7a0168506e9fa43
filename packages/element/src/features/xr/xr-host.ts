import type { Camera, Lazy } from '@gaussian-splat/core';
import type { World } from '@gaussian-splat/renderer';
import type { Attributes } from '../../viewer/attributes.js';
import type { ViewerFrame } from '../../viewer/camera/orbit.js';
import type { ScenePoint } from '../../viewer/camera/values.js';
import type { AnnouncerController } from '../input/announcer-controller.js';
import type { CameraController } from '../../viewer/camera-controller.js';
import type { Backend } from '../../gpu/backend.js';
import type { LoadedGaussians } from '../../gpu/loaded-gaussians.js';
import type { SceneRequest } from '../../loading/protocol.js';
import type { SceneLoader } from '../../loading/scene-loader.js';
import type { A11yStrings } from '../../viewer/strings.js';

/** The part of the element that VR, AR and the ruler use. */
export interface XrHost {
  readonly element: HTMLElement;
  readonly attributes: Attributes;
  readonly camera: CameraController;
  readonly surface: HTMLElement | null;
  readonly strings: A11yStrings;
  readonly frame: ViewerFrame;
  readonly services: { readonly sceneLoader: SceneLoader };
  /** Request of the displayed scene; null while no scene is shown, and for one that moves. */
  readonly walkable: SceneRequest | null;
  readonly sources: {
    /** All displayed scenes. */
    readonly shown: readonly LoadedGaussians[];
    readonly isPreview: boolean;
    /** The world with all displayed scenes. */
    readonly world: World;
    /** Advances moving scenes to the time of a frame. @param now requestAnimationFrame's clock, ms. */
    advance(camera: Camera, now: number): void;
    /** Stops the clocks of moving scenes until the next frame, so that the time until then does not count. */
    suspend(): void;
    readonly ownEntry: {
      readonly scene: { readonly scene: LoadedGaussians | null; readonly isOutgoing: boolean; readonly url: string };
    };
  };
  readonly view: { readonly backend: Backend | null; applyRendering(backend: Backend): void };
  /** Updates the world before a frame. Returns a text that changes whenever the frame would change. */
  prepareFrame(): string;
  readonly reveal: { dismiss(): void };
  readonly behaviors: { readonly announcer: Lazy<AnnouncerController> };
  readonly isOnShow: boolean;
  /** The camera of the last frame, with the size of the frame in pixels; undefined before the first frame. */
  readonly drawnFrom: Camera | undefined;
  /** Whether a VR or AR session shows the scene. The page does not draw meanwhile. */
  isImmersed: boolean;
  requestFrame(): void;
  positionFromPoint(clientX: number, clientY: number): Promise<ScenePoint | null>;
  warn(sentence: string): void;
}
