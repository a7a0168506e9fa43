import { dot, multiply, subtract, type Vector3 } from '@gaussian-splat/core';
import { toViewer } from '../../viewer/camera/orbit.js';
import type { Viewer } from '../../viewer/viewer.js';
import { adoptStyles } from '../../viewer/styles.js';
import { AR_STYLES, ArOverlay } from './ar-overlay.js';
import { readShadow, shadowSplats, takeShadow } from '../../shared/shadow-map.js';
import { alphaOfScene } from '../../shared/take-alpha-gl.js';
import { fingersOn, type Fingers, type Plane } from './fingers.js';
import { GlDrawing } from './gl-drawing.js';
import { Leaving } from './leaving.js';
import { placeOf } from './marker-splats.js';
import type { XrScene } from './xr-scene.js';
import { SimplifiedModel } from './simplified-model.js';
import { unitOf } from '../../viewer/unit.js';
import { metersOf } from './vr.js';
import type { XrFrame, XrHit, XrAnchor, XrHitTestSource, XrPose } from './webxr.js';
import { XrOffer, type XrKind, type XrStarted } from './xr-offer.js';
import type { XrEye, XrMarker } from './xr-drawing.js';
import type { XrGuide } from './xr-session.js';

/** Minimum and maximum initial size of an object, meters. */
const [SMALLEST, LARGEST] = [0.5, 1];
/** Minimum and maximum scale that gestures can set, as a factor of true size. */
const [MIN_SCALE, MAX_SCALE] = [0.05, 20];
/** Maximum difference from true size, as a scale, within which the scale snaps to 1. */
const SNAP = 0.05;
/** Downward angle, radians, of the ray that searches for the floor, from the center of the view. */
const DOWN = (20 * Math.PI) / 180;
/** Vertical component of a unit normal, 0..1, above which a surface is a floor, and below which it is a wall. */
const LEVEL = 0.75;
/** Seconds for which a floor is preferred to walls in the view ray, or a wall to floors. */
const PREFERENCE_TIMEOUT = 1;
/** Fraction of the subject's splats that may be below the floor. */
const BELOW = 0.01;
/** Maximum number of splats whose heights are sorted, because the session waits for that. */
const MAX_HEIGHTS = 65_536;

/** Size of the subject and its position on the floor, in units of viewer space. */
interface Footprint {
  /** Center of the subject's base in viewer space. */
  readonly base: Vector3;
  readonly height: number;
  readonly radius: number;
  /** [N, 3] positions of all splats; NaN for those outside the subject. */
  readonly positions: Float32Array;
  /** Indices of the splats of the subject. */
  readonly splats: Uint32Array;
}

/**
 * Computes the footprint of the splats in the framing sphere. Its height ignores the lowest and the highest hundredth
 * of them.
 * @param positions [N, 3] relative to `origin`
 */
export function footprintOf(core: Viewer, positions: Float32Array, origin: Vector3): Footprint {
  const { center, radius } = core.camera.bounds;
  const { frame } = core;
  const kept = positions.slice();
  const inside = new Uint32Array(positions.length / 3);
  let count = 0;
  const from = subtract(origin, center);
  for (let at = 0; at < positions.length; at += 3) {
    const [x, y, z] = [positions[at] + from[0], positions[at + 1] + from[1], positions[at + 2] + from[2]];
    if (x * x + y * y + z * z <= radius * radius) inside[count++] = at / 3;
    else kept[at] = kept[at + 1] = kept[at + 2] = NaN;
  }
  const splats = inside.subarray(0, count);
  const step = Math.max(1, Math.ceil(count / MAX_HEIGHTS));
  const sorted = Float64Array.from({ length: Math.ceil(count / step) }, (_, k) => {
    const at = 3 * splats[k * step];
    return dot(frame[1], [positions[at] + origin[0], positions[at + 1] + origin[1], positions[at + 2] + origin[2]]);
  }).sort();
  const low = sorted[Math.floor(BELOW * sorted.length)] ?? 0;
  const high = sorted[Math.floor((1 - BELOW) * (sorted.length - 1))] ?? 0;
  const [x, , z] = toViewer(frame, center);
  return { base: [x, low, z], height: high - low, radius, positions: kept, splats };
}

/** Offers AR: with WebXR if it is available, or on iPhones with the author's own model. */
export function openAr(core: Viewer): XrOffer {
  const { element } = core;
  adoptStyles(element.shadowRoot!, AR_STYLES);
  const overlay = new ArOverlay(core);
  const offer = new XrOffer(core, arKind(core, overlay));
  overlay.onExit = () => offer.end();
  element.addController(new SimplifiedModel(core, offer));
  return offer;
}

const arKind = (core: Viewer, overlay: ArOverlay): XrKind => ({
  ...{ mode: 'immersive-ar', name: 'ar', word: 'ar' },
  isWanted: () => core.attributes.ar && /(^|\s)webxr(\s|$)/.test(core.attributes.arModes?.trim() || 'webxr'),
  options: () => ({
    requiredFeatures: ['hit-test'],
    optionalFeatures: ['anchors', 'local-floor', 'dom-overlay'],
    domOverlay: { root: overlay.root },
  }),
  canShow: () => core.stillRequest !== null,
  spaces: ['local-floor', 'local'],
  open: (session, source) => GlDrawing.open(session, core, source),
  guide: (started) => new ArGuide(core, started, overlay),
});

/** Places the subject where the view ray first hits a real surface. Gestures then move, turn and scale it. */
class ArGuide implements XrGuide {
  readonly background = [0, 0, 0, 0] as const;
  readonly #core: Viewer;
  readonly #of: XrStarted;
  readonly #overlay: ArOverlay;
  #shadow: { readonly splats: XrMarker; readonly half: number } | undefined;
  readonly #unit: number;
  #source: XrHitTestSource | undefined;
  #footprint: Footprint | undefined;
  #at: Vector3 | undefined;
  #turn = 0;
  #scale = 1;
  #anchor: XrAnchor | undefined;
  /** Seconds with hits of other surfaces than the wanted ones. */
  #waited = 0;
  #fingers: Fingers | undefined;
  /** Headsets show no overlay, so their inputs leave. */
  readonly #leaving: Leaving;
  #placed: Float64Array | undefined;

  constructor(core: Viewer, of: XrStarted, overlay: ArOverlay) {
    this.#core = core;
    this.#of = of;
    this.#overlay = overlay;
    const unit = unitOf(core);
    if (unit === undefined && core.attributes.arScale === 'fixed')
      core.warn(
        '<gaussian-splat> ar-scale="fixed": expected the attribute unit, such as unit="1m"; the object is 0.5 to 1 m large.',
      );
    this.#unit = unit ?? 1;
    this.#leaving = new Leaving(of.session, of.signal);
    overlay.show();
    of.signal.addEventListener('abort', () => {
      overlay.hide();
      this.#source?.cancel();
    });
    this.#listen().catch(({ message }: Error) => {
      // Without hit tests, no place can be found.
      if (!of.signal.aborted) of.drawing.onLost(message);
    });
  }

  place(frame: XrFrame, pose: XrPose, seconds: number): Float64Array | null {
    this.#leaving.advance(seconds);
    const found = this.#drawing.scene;
    if (!found) return null;
    if (!this.#footprint) {
      this.#footprint = footprintOf(this.#core, found.positions, found.origin);
      this.#drawing.crop(this.#footprint.positions);
      this.#scale = this.#firstScale(this.#footprint);
      this.#castShadow(found, this.#footprint).catch(({ message }: Error) => this.#core.warn(message));
    }
    if (!this.#at) this.#look(frame, pose, seconds);
    if (!this.#at) return null;
    this.#follow(frame);
    this.#touch(frame);
    return (this.#placed = this.#matrix(this.#at, this.#footprint));
  }

  drawAbove({ room }: XrEye): void {
    if (!this.#placed) return;
    const worldToCamera = multiply(room.worldToCamera, this.#placed);
    this.#overlay.labels.place({ ...room, worldToCamera }, this.#core.frame);
  }

  drawBelow(eye: XrEye): void {
    if (!this.#at || !this.#footprint || this.#isWall) return;
    if (!this.#shadow) return;
    const { splats, half } = this.#shadow;
    splats.draw(eye, placeOf(this.#at, half * this.#size * this.#unit, this.#turn));
  }

  /** Creates the shadow of the page for the subject alone. */
  async #castShadow({ renderer }: XrScene, { splats: kept, radius }: Footprint): Promise<void> {
    const { signal } = this.#of;
    const { camera, frame, attributes } = this.#core;
    const { take, free } = alphaOfScene(this.#drawing.gl, renderer, kept);
    const center = toViewer(frame, camera.bounds.center);
    const map = await takeShadow({ center, radius, frame }, take).finally(free);
    if (map === null || signal.aborted) return;
    const { intensity, softness } = readShadow(this.#core);
    const rows = shadowSplats(map, attributes.shadowIntensity ? intensity : 1, softness);
    const splats = this.#drawing.marker(rows, signal);
    this.#shadow = { splats, half: map.half };
  }

  /** The drawing of the session; AR always draws with WebGL. */
  get #drawing(): GlDrawing {
    return this.#of.drawing as GlDrawing;
  }

  get #isWall(): boolean {
    return this.#core.attributes.arPlacement === 'wall';
  }

  get #isFixed(): boolean {
    const { attributes } = this.#core;
    return attributes.arScale === 'fixed' && Boolean(attributes.unit);
  }

  #firstScale({ radius, height }: Footprint): number {
    if (this.#isFixed) return 1;
    const size = Math.max(2 * radius, height) * this.#unit;
    return Math.min(LARGEST, Math.max(SMALLEST, size)) / size;
  }

  async #listen(): Promise<void> {
    const { session, signal } = this.#of;
    const space = await session.requestReferenceSpace('viewer');
    const { XRRay } = globalThis as unknown as { XRRay?: new (origin: object, direction: object) => unknown };
    const down = this.#isWall ? 0 : DOWN;
    const offsetRay =
      XRRay && new XRRay({ x: 0, y: 0, z: 0, w: 1 }, { x: 0, y: -Math.sin(down), z: -Math.cos(down), w: 0 });
    const source = await session.requestHitTestSource?.({ space, ...(offsetRay ? { offsetRay } : {}) });
    if (signal.aborted) source?.cancel();
    else this.#source = source;
  }

  /** Places the subject at the first surface that the view ray hits, with a preference for floors, or for walls. */
  #look(frame: XrFrame, pose: XrPose, seconds: number): void {
    const hits = ((this.#source && frame.getHitTestResults?.(this.#source)) ?? []).flatMap((hit) => {
      const at = hit.getPose(this.#of.space)?.transform;
      return at ? [{ hit, at }] : [];
    });
    // The y axis of a hit is the normal of its surface.
    const isWanted = ({ at }: (typeof hits)[number]): boolean =>
      this.#isWall ? Math.abs(at.matrix[5]) < LEVEL : at.matrix[5] > LEVEL;
    if (hits.length > 0) this.#waited += seconds;
    const found = hits.find(isWanted) ?? (this.#waited > PREFERENCE_TIMEOUT ? hits[0] : undefined);
    if (!found) return;
    const { hit, at } = found;
    const { x, y, z } = at.position;
    this.#at = [x, y, z];
    const viewer = pose.transform.position;
    const [towardX, towardZ] = this.#isWall ? [at.matrix[4], at.matrix[6]] : [viewer.x - x, viewer.z - z];
    // Turns the front of the subject, +z, toward the user, or away from the wall.
    this.#turn = Math.atan2(towardX, towardZ);
    this.#source?.cancel();
    this.#source = undefined;
    this.#overlay.placed();
    this.#of.offer.status('object-placed');
    void this.#holdOn(hit);
  }

  async #holdOn(hit: XrHit): Promise<void> {
    const at = this.#at;
    const anchor = await hit.createAnchor?.().catch(() => undefined);
    // A finger may have moved the subject meanwhile.
    if (this.#at === at) this.#anchor = anchor;
    else anchor?.delete();
  }

  /** Follows the anchor, because tracking of the real environment improves over time. */
  #follow(frame: XrFrame): void {
    if (!this.#anchor) return;
    const place = frame.getPose(this.#anchor.anchorSpace, this.#of.space)?.transform.position;
    if (place) this.#at = [place.x, place.y, place.z];
  }

  /** Axes of the plane that the subject stands on or hangs at. */
  get #axes(): Plane['axes'] {
    const right: Vector3 = this.#isWall ? [Math.cos(this.#turn), 0, -Math.sin(this.#turn)] : [1, 0, 0];
    return [right, this.#isWall ? [0, 1, 0] : [0, 0, 1]];
  }

  /**
   * Applies gestures: one finger moves the object on its plane, two fingers scale it, and turn it unless it hangs at a
   * wall.
   */
  #touch(frame: XrFrame): void {
    const axes = this.#axes;
    const fingers = fingersOn({ point: this.#at!, axes }, frame, this.#of.space);
    const before = this.#fingers;
    this.#fingers = fingers;
    if (!fingers || !before || fingers.count !== before.count) return;
    this.#anchor?.delete();
    this.#anchor = undefined;
    const [u, v] = [fingers.u - before.u, fingers.v - before.v];
    this.#at = this.#at!.map((value, k) => value + u * axes[0][k] + v * axes[1][k]) as unknown as Vector3;
    if (fingers.count < 2) return;
    if (!this.#isWall) this.#turn -= fingers.angle - before.angle;
    if (this.#isFixed || before.apart === 0) return;
    this.#scale = Math.min(MAX_SCALE, Math.max(MIN_SCALE, (this.#scale * fingers.apart) / before.apart));
  }

  /** Scale of the subject, which snaps to true size. The scale of the gestures does not, or it could not leave 1. */
  get #size(): number {
    return this.#core.attributes.unit && Math.abs(this.#scale - 1) < SNAP ? 1 : this.#scale;
  }

  #matrix([x, y, z]: Vector3, { base, height, radius }: Footprint): Float64Array {
    const size = this.#size;
    const [sin, cos] = [size * Math.sin(this.#turn), size * Math.cos(this.#turn)];
    const meters = metersOf(this.#core.frame, this.#unit);
    // The center of the subject's base is placed at the hit point; on a wall, the center of its back.
    const [lift, back] = this.#isWall ? [height / 2, -radius] : [0, 0];
    const [px, py, pz] = [base[0], base[1] + lift, base[2] + back].map((value) => value * this.#unit);
    const turn = [cos, 0, sin, x, 0, size, 0, y, -sin, 0, cos, z, 0, 0, 0, 1];
    const move = [1, 0, 0, -px, 0, 1, 0, -py, 0, 0, 1, -pz, 0, 0, 0, 1];
    return Float64Array.from(multiply(multiply(turn, move), meters));
  }
}
