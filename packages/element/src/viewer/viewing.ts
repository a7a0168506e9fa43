import type { CameraOrbit, CameraTarget, FieldOfView, PickedPoint } from './camera/values.js';
import { MediaProperties } from './media.js';
import { boxOf, type SceneBox } from './scene-queries.js';
import type { CameraView } from './camera/camera-view.js';
import type { HotspotController, InputController, Recording, Tour } from './feature-classes.js';
import type {
  DepthOptions,
  FlightOptions,
  FrameOptions,
  HotspotPlace,
  ImageOptions,
  MeasuredView,
  PathOptions,
  RecordOptions,
} from './feature-table.js';

/** Methods of the element for its poster, the camera, surface positions, and images. */
export abstract class ViewingMethods extends MediaProperties {
  /** Applies changed attributes at once, for code that calls a method just after it has set an attribute. */
  protected abstract applyAttributes(): void;

  /** Whether no poster covers the scene. */
  get revealed(): boolean {
    return !this.core.reveal.isCovered;
  }

  /** Dismisses the poster and loads a lazy scene. With `reveal="manual"`, the scene is shown only after this call. */
  dismissPoster(): void {
    this.core.reveal.dismiss();
  }

  /** Covers the scene with its poster again. */
  showPoster(): void {
    this.core.reveal.cover();
  }

  /** Returns the current position of the camera. Its string form is a value for `camera-orbit`. */
  getCameraOrbit(): CameraOrbit {
    return this.core.camera.orbit;
  }

  /** Returns the point that the camera looks at. Its string form is a value for `camera-target`. */
  getCameraTarget(): CameraTarget {
    return this.core.camera.target;
  }

  /** Returns the current vertical field of view. Its string form is a value for `field-of-view`. */
  getFieldOfView(): FieldOfView {
    return this.core.camera.fieldOfView;
  }

  /** Ends a motion of the camera at once, at its goal. */
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
   * Flies to a view after the scene has loaded. Visitors who prefer reduced motion jump there at once.
   * @param view Name or index (from 0) of a view of the page's list, or any other view.
   * @returns Fulfills at the end: true on arrival, false if a visitor, an attribute or another flight took over the
   * camera. Rejects with `argument/camera` for a malformed view or an unknown name.
   */
  async flyTo(view: CameraView | string | number, options?: FlightOptions): Promise<boolean> {
    return (await this.#tour).flyTo(view, options);
  }

  /** Flies to the next view of the list, and from the last to the first. See {@link flyTo}. */
  async nextView(options?: FlightOptions): Promise<boolean> {
    return (await this.#tour).step(1, options);
  }

  /** Flies to the previous view of the list. See {@link flyTo}. */
  async previousView(options?: FlightOptions): Promise<boolean> {
    return (await this.#tour).step(-1, options);
  }

  /** Flies through all views of the list on one smooth path, or along the keyframes of its file. See {@link flyTo}. */
  async flyPath(options?: PathOptions): Promise<boolean> {
    return (await this.#tour).flyPath(options);
  }

  /**
   * Moves the camera at once to a position on the path of {@link flyPath}, for scenes that follow the page's scrolling.
   * @param share 0..1, from the first view to the last
   */
  async seekPath(share: number): Promise<void> {
    return (await this.#tour).seekPath(share);
  }

  /** Shows the interaction prompt again, as if no visitor had moved the scene. */
  resetInteractionPrompt(): void {
    this.core.features.get<InputController>('input').value?.prompt.reset();
  }

  /** Moves the camera to frame the scene, as after loading, for generators whose scene has grown or moved. */
  async updateFraming(): Promise<void> {
    this.applyAttributes();
    await this.core.updateFraming();
  }

  /** Returns the box around nearly all splats of the scene, in meters of viewer space; null while no scene is shown. */
  getBoundingBox(): SceneBox | null {
    return boxOf(this.core.camera.viewerFrame, this.core.sources.bounds);
  }

  /**
   * Returns the visible surface of the scene under a point of the page, in the form of `data-position` and
   * `camera-target`. Reads back from the GPU asynchronously. The point is on the plane that returns the light around it.
   * `uncertainty` is half of an interval along the line of sight, in units of viewer space, that contains the surface in
   * 68 % of the cases or more; Infinity at glass, haze, and single splats. `element`, `splat`, `mesh` and `material`
   * identify the hit.
   * @param clientX CSS pixels, same as in a MouseEvent.
   * @returns null outside the scene, and on parts less than half opaque.
   */
  positionFromPoint(clientX: number, clientY: number): Promise<PickedPoint | null> {
    return this.core.positionFromPoint(clientX, clientY);
  }

  /**
   * Returns the current position of the hotspot in a slot, for example `hotspot-door`; null if no hotspot with a
   * position has this name.
   */
  queryHotspot(name: string): HotspotPlace | null {
    return this.core.features.get<HotspotController>('labels').value?.query(name) ?? null;
  }

  /**
   * Draws the current image again and encodes it, with the CSS filters of the element. A transparent image cannot
   * contain colors that exceed their alpha: set `background` if the scene has such colors. PNG and JPEG contain the
   * credits of the scene as XMP.
   * @returns Rejects with an `InvalidStateError` if no scene is shown or the element has no size, with a `RangeError`
   * for a size that the GPU cannot draw, and with a `TypeError` for an invalid background color.
   */
  async toBlob(options: ImageOptions = {}): Promise<Blob> {
    return (await this.#images()).takeImage(this.core, options);
  }

  /**
   * Measures the current view in one pass: depth in meters along the optical axis, coverage, and the element or child
   * at each pixel. It contains no meshes and no shadow, and ignores `order`.
   * @returns Rejects with an `InvalidStateError` if no scene is shown, with a `NotSupportedError` if the scene has
   * meshes, with a `RangeError` for a size that the GPU cannot draw, and with `unsupported/webgl` without WebGPU.
   */
  async renderDepth(options: DepthOptions = {}): Promise<MeasuredView> {
    return (await this.#images()).renderDepth(this.core, options);
  }

  /**
   * Records a video of the element in real time: along the camera's `path`, for a `duration`, or until `signal` is
   * aborted. Afterwards the camera returns to its pose. The video has the sound of the child with `slot="sound"`, also if
   * that is muted, if the browser can capture it (Chromium) and the visitor has interacted with the page.
   * @returns Rejects with an `InvalidStateError` if no scene is shown or another recording has not ended, with a
   * `NotSupportedError` if the browser cannot record this type, and with a `TypeError` if the page has no views to
   * follow, if no option ends the recording, or if the background is not a color.
   */
  async record(options: RecordOptions = {}): Promise<Blob> {
    return (await this.#images()).record(this.core, options);
  }

  /**
   * Yields the images of a video one by one. Each frame is drawn for its own time, however long that takes: `for await
   * (const image of element.recordFrames({ path: 'turntable' }))`. The frames are equal to those of `gaussian-splat
   * video`. An animated scene advances by the duration of a frame, and must be visible. An element has one recording at
   * a time: a loop that does not end must call `return()`.
   */
  async *recordFrames(options: FrameOptions = {}): AsyncGenerator<Blob, void> {
    yield* (await this.#images()).recordFrames(this.core, options);
  }

  get #tour(): Promise<Tour> {
    return this.core.features.get<Tour>('views').get();
  }

  async #images(): Promise<Recording> {
    const images = await this.core.features.get<Recording>('recording').get();
    this.applyAttributes();
    return images;
  }

  /**
   * Synchronous form of {@link toBlob}: returns a `data:` URL, without CSS filters and credits.
   * @throws DOMException `InvalidStateError` if no scene is shown or the element has no size
   */
  toDataURL(mimeType = 'image/png', qualityArgument?: number): string {
    this.applyAttributes();
    const canvas = this.core.drawNow();
    if (canvas === null)
      throw new DOMException('Expected a loaded scene and an element with a size', 'InvalidStateError');
    return canvas.toDataURL(mimeType, qualityArgument);
  }
}
