import { loadModule } from '@gaussian-splat/core';
import type { CameraOrbit, CameraTarget, FieldOfView, PickedPoint } from './camera/values.js';
import type { HotspotPlace } from './controllers/hotspot-controller.js';
import { MediaProperties } from './media.js';
import { boxOf, type SceneBox } from './scene-queries.js';
import type { CameraView } from './views/camera-view.js';
import type { FlightOptions, PathOptions } from './views/tour.js';

/** An image to take. */
export interface ImageOptions {
  /** Default `image/png`. */
  readonly mimeType?: string;
  /** 0..1, for formats that lose some. */
  readonly qualityArgument?: number;
  /** Pixels. Default: as large as the element is drawn; one of the two alone keeps its shape. */
  readonly width?: number;
  readonly height?: number;
  /** A CSS colour behind the scene. Default: transparent. */
  readonly background?: string;
}

/** What scripts ask of the picture: its poster, its camera, what lies under a point of it, and the picture itself. */
export abstract class ViewingMethods extends MediaProperties {
  /** Attributes count at once for those who call a method right after setting one. */
  protected abstract applyAttributes(): void;

  /** True while the poster does not cover the scene. */
  get revealed(): boolean {
    return !this.stage.reveal.isCovered;
  }

  /** Lets the scene be seen as soon as it can be, and a lazy one be loaded: what `reveal="manual"` waits for. */
  dismissPoster(): void {
    this.stage.reveal.dismiss();
  }

  /** Covers the scene with its poster again. */
  showPoster(): void {
    this.stage.reveal.cover();
  }

  /** Where the camera is now; as a string, a value for `camera-orbit`. */
  getCameraOrbit(): CameraOrbit {
    return this.stage.camera.orbit;
  }

  /** What the camera looks at now; as a string, a value for `camera-target`. */
  getCameraTarget(): CameraTarget {
    return this.stage.camera.target;
  }

  /** Vertical field of view now; as a string, a value for `field-of-view`. */
  getFieldOfView(): FieldOfView {
    return this.stage.camera.fieldOfView;
  }

  /** Ends the camera's motion where it was going. */
  jumpCameraToGoal(): void {
    this.applyAttributes();
    this.stage.camera.jumpToGoal();
  }

  /** Brings the camera back to where the attributes put it. */
  resetCamera(): void {
    this.applyAttributes();
    this.stage.camera.reset('none');
  }

  /**
   * Flies to a view: one of the page's list by its name or its place in it (from 0), or any other. Waits for the scene. Visitors who ask for less motion are there at once.
   * @returns fulfils at the end: true on arrival, false where a visitor, an attribute or another flight has taken the camera. Rejects with
   * `argument/camera` for a view that is malformed or has no such name.
   */
  async flyTo(view: CameraView | string | number, options?: FlightOptions): Promise<boolean> {
    return (await this.stage.tour.get()).flyTo(view, options);
  }

  /** Flies to the next view of the list, after the last to the first. As {@link flyTo}. */
  async nextView(options?: FlightOptions): Promise<boolean> {
    return (await this.stage.tour.get()).step(1, options);
  }

  /** Flies to the view before. As {@link flyTo}. */
  async previousView(options?: FlightOptions): Promise<boolean> {
    return (await this.stage.tour.get()).step(-1, options);
  }

  /** Flies along all views of the list on one smooth path, or along the keyframes that its file has. As {@link flyTo}. */
  async flyAlong(options?: PathOptions): Promise<boolean> {
    return (await this.stage.tour.get()).flyAlong(options);
  }

  /**
   * Puts the camera on that path, at once: for scenes that follow the page's scrolling.
   * @param share 0..1, from the first view to the last
   */
  async showAlong(share: number): Promise<void> {
    return (await this.stage.tour.get()).showAlong(share);
  }

  /** Lets the interaction prompt come again, as if no visitor had touched the scene. */
  resetInteractionPrompt(): void {
    this.stage.behaviours.prompt?.reset();
  }

  /** Frames the scene as if it had just been loaded: for generators whose scene has grown or gone elsewhere. */
  async updateFraming(): Promise<void> {
    this.applyAttributes();
    await this.stage.updateFraming();
  }

  /** Box around nearly all of the scene, in metres of viewer space; null while none is shown. */
  getBoundingBox(): SceneBox | null {
    return boxOf({ camera: this.stage.camera, bounds: this.stage.sources.bounds });
  }

  /**
   * The visible surface of the scene under a point of the page: what `data-position` and `camera-target` take. Asks the GPU, beside the
   * frames. `uncertainty` of the point says how far the surface spreads along the line of sight, `element`, `splat`, `mesh` and `material` what was met.
   * @param clientX CSS pixels, as of a MouseEvent.
   * @returns null beside the scene, and where it is more transparent than not.
   */
  positionFromPoint(clientX: number, clientY: number): Promise<PickedPoint | null> {
    return this.stage.positionFromPoint(clientX, clientY);
  }

  /** Where the hotspot of a slot is now, for example `hotspot-door`; null if there is none with a position. */
  queryHotspot(name: string): HotspotPlace | null {
    return this.stage.labels.value?.query(name) ?? null;
  }

  /**
   * The image as it is on the screen now, with the CSS filters of the element, drawn anew. A colour that exceeds its alpha has no place in a transparent image: give `background` where the scene has such.
   * @returns rejects with an `InvalidStateError` where no scene is shown, or the element has no size; with a `RangeError` for a size that the GPU
   * cannot draw, and a `TypeError` for a background that is no colour.
   */
  async toBlob(options: ImageOptions = {}): Promise<Blob> {
    const { takePicture } = await loadModule('the code for images', () => import('./picture.js'));
    this.applyAttributes();
    return takePicture(this.stage, options);
  }

  /** The same as a `data:` URL, at once and without CSS filters. Throws an `InvalidStateError` where no scene is shown, or the element has no size. */
  toDataURL(mimeType = 'image/png', qualityArgument?: number): string {
    this.applyAttributes();
    const canvas = this.stage.drawNow();
    if (canvas === null)
      throw new DOMException('Expected a loaded scene in an element that has a size', 'InvalidStateError');
    return canvas.toDataURL(mimeType, qualityArgument);
  }
}
