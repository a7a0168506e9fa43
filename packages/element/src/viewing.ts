import { loadModule } from '@gaussian-splat/core';
import type { CameraOrbit, CameraTarget, FieldOfView, PickedPoint } from './camera/values.js';
import type { HotspotPlace } from './controllers/hotspot-controller.js';
import { MediaProperties } from './media.js';
import type * as capture from './capture-image.js';
import type { FrameOptions, RecordOptions } from './recording.js';
import { boxOf, type SceneBox } from './scene-queries.js';
import type { CameraView } from './views/camera-view.js';
import type { FlightOptions, PathOptions } from './views/tour.js';

/** An image to take. */
export interface ImageOptions {
  /** Default `image/png`. */
  readonly mimeType?: string;
  /** 0..1, for formats that lose some. */
  readonly qualityArgument?: number;
  /** Pixels. Default: the drawn size of the element; one of the two alone keeps the aspect ratio. */
  readonly width?: number;
  readonly height?: number;
  /** CSS color behind the scene. Default: transparent. */
  readonly background?: string;
}

/** Poster, camera, surface positions, and images for scripts. */
export abstract class ViewingMethods extends MediaProperties {
  /** Attributes apply at once for code that calls a method right after setting one. */
  protected abstract applyAttributes(): void;

  /** True while the poster does not cover the scene. */
  get revealed(): boolean {
    return !this.core.reveal.isCovered;
  }

  /** Shows the scene as soon as possible, and loads a lazy one: `reveal="manual"` waits for this call. */
  dismissPoster(): void {
    this.core.reveal.dismiss();
  }

  /** Covers the scene with its poster again. */
  showPoster(): void {
    this.core.reveal.cover();
  }

  /** The current position of the camera; as a string, a value for `camera-orbit`. */
  getCameraOrbit(): CameraOrbit {
    return this.core.camera.orbit;
  }

  /** The point that the camera looks at; as a string, a value for `camera-target`. */
  getCameraTarget(): CameraTarget {
    return this.core.camera.target;
  }

  /** The current vertical field of view; as a string, a value for `field-of-view`. */
  getFieldOfView(): FieldOfView {
    return this.core.camera.fieldOfView;
  }

  /** Jumps to the goal of the camera's current motion. */
  jumpCameraToGoal(): void {
    this.applyAttributes();
    this.core.camera.jumpToGoal();
  }

  /** Resets the camera to the pose of the attributes. */
  resetCamera(): void {
    this.applyAttributes();
    this.core.camera.reset('none');
  }

  /**
   * Flies to a view: a name or index (from 0) of the page's list, or any other view. Waits for the scene. Visitors who
   * prefer reduced motion jump there at once.
   * @returns fulfills at the end: true on arrival, false if a visitor, an attribute or another flight took over the
   * camera. Rejects with `argument/camera` for a malformed view or an unknown name.
   */
  async flyTo(view: CameraView | string | number, options?: FlightOptions): Promise<boolean> {
    return (await this.core.tour.get()).flyTo(view, options);
  }

  /** Flies to the next view of the list, and from the last to the first. See {@link flyTo}. */
  async nextView(options?: FlightOptions): Promise<boolean> {
    return (await this.core.tour.get()).step(1, options);
  }

  /** Flies to the previous view of the list. See {@link flyTo}. */
  async previousView(options?: FlightOptions): Promise<boolean> {
    return (await this.core.tour.get()).step(-1, options);
  }

  /** Flies through all views of the list on one smooth path, or along the keyframes of its file. See {@link flyTo}. */
  async flyPath(options?: PathOptions): Promise<boolean> {
    return (await this.core.tour.get()).flyPath(options);
  }

  /**
   * Puts the camera on that path at once, for scenes that follow the page's scrolling.
   * @param share 0..1, from the first view to the last
   */
  async seekPath(share: number): Promise<void> {
    return (await this.core.tour.get()).seekPath(share);
  }

  /** Shows the interaction prompt again, as if no visitor had touched the scene. */
  resetInteractionPrompt(): void {
    this.core.behaviors.prompt?.reset();
  }

  /** Frames the scene as after loading, for generators whose scene has grown or moved. */
  async updateFraming(): Promise<void> {
    this.applyAttributes();
    await this.core.updateFraming();
  }

  /** Box around nearly all of the scene, in meters of viewer space; null while none is shown. */
  getBoundingBox(): SceneBox | null {
    return boxOf({ camera: this.core.camera, bounds: this.core.sources.bounds });
  }

  /**
   * The visible surface of the scene under a point of the page, in the form of `data-position` and `camera-target`.
   * Reads back from the GPU asynchronously. `uncertainty` of the point is the spread of the surface along the line of
   * sight; `element`, `splat`, `mesh` and `material` identify the hit.
   * @param clientX CSS pixels, like that of a MouseEvent.
   * @returns null outside the scene, and on parts less than half opaque.
   */
  positionFromPoint(clientX: number, clientY: number): Promise<PickedPoint | null> {
    return this.core.positionFromPoint(clientX, clientY);
  }

  /** The current position of the hotspot in a slot, for example `hotspot-door`; null if there is none with a position. */
  queryHotspot(name: string): HotspotPlace | null {
    return this.core.labels.value?.query(name) ?? null;
  }

  /**
   * The current image of the screen, drawn again, with the CSS filters of the element. A transparent image cannot hold
   * colors that exceed their alpha: set `background` if the scene has such.
   * @returns rejects with an `InvalidStateError` if no scene is shown or the element has no size, with a `RangeError`
   * for a size that the GPU cannot draw, and with a `TypeError` for an invalid background color.
   */
  async toBlob(options: ImageOptions = {}): Promise<Blob> {
    return (await this.#images()).takeImage(this.core, options);
  }

  /**
   * A video of what the element shows, recorded by the browser while it happens: of the camera's `path`, for a `duration`, or until the `signal`. The camera comes back afterwards.
   * @returns rejects with an `InvalidStateError` where no scene is shown, with a `NotSupportedError` where the browser does not record this type, and with a `TypeError` without views
   * to follow, without an end, and for a background that is no color.
   */
  async record(options: RecordOptions = {}): Promise<Blob> {
    return (await this.#images()).record(this.core, options);
  }

  /**
   * The same frame by frame, each drawn for its own time however long that takes: `for await (const image of element.recordFrames({ path: 'turntable' }))`. They are the frames of
   * `gaussian-splat video`. An animated scene advances by the time of a frame, and must be visible.
   */
  async *recordFrames(options: FrameOptions = {}): AsyncGenerator<Blob, void> {
    yield* (await this.#images()).recordFrames(this.core, options);
  }

  async #images(): Promise<typeof capture> {
    const images = await loadModule('the code for images', () => import('./capture-image.js'));
    this.applyAttributes();
    return images;
  }

  /**
   * Synchronous form of {@link toBlob} as a `data:` URL, without CSS filters. Throws an `InvalidStateError` if no scene
   * is shown or the element has no size.
   */
  toDataURL(mimeType = 'image/png', qualityArgument?: number): string {
    this.applyAttributes();
    const canvas = this.core.drawNow();
    if (canvas === null)
      throw new DOMException('Expected a loaded scene in an element that has a size', 'InvalidStateError');
    return canvas.toDataURL(mimeType, qualityArgument);
  }
}
