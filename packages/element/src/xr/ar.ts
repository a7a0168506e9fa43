import { multiply, type Camera, type Vector3 } from '@gaussian-splat/core';
import type { ReactiveControllerHost } from 'lit';
import { toViewer } from '../camera/orbit.js';
import type { XrHost } from './xr-host.js';
import { adoptStyles } from '../styles.js';
import { AR_STYLES, ArOverlay } from './ar-overlay.js';
import { readShadow } from '../shadow/shadow-controller.js';
import { shadowSplats, takeShadow } from '../shadow/shadow-map.js';
import { alphaOfScene } from '../shadow/take-alpha-gl.js';
import { MarkerSplats, placeOf } from './marker-splats.js';
import type { XrScene } from './xr-scene.js';
import { SimplifiedModel } from './simplified-model.js';
import { metersOf, unitOf } from './vr.js';
import type { XrFrame, XrHit, XrAnchor, XrHitTestSource, XrInput, XrPose } from './webxr.js';
import { XrOffer, type XrKind, type XrStarted } from './xr-offer.js';
import type { XrGuide } from './xr-session.js';

/** Range of an object's initial size, meters. */
const [SMALLEST, LARGEST] = [0.5, 1];
/** Range of scales for gestures. */
const [MIN_SCALE, MAX_SCALE] = [0.05, 20];
/** Scales this close to true size snap to it. */
const SNAP = 0.05;
/** Downward angle of the ray that searches for the floor, from the center of the view, radians. */
const DOWN = (20 * Math.PI) / 180;
/** Fraction of the subject's splats that may lie below the floor. */
const BELOW = 0.01;

/** The subject's footprint on the floor. */
interface Footprint {
  /** Center of its base, viewer space, units. */
  readonly base: Vector3;
  readonly height: number;
  readonly radius: number;
  /** Positions, with NaN for splats outside the subject. */
  readonly positions: Float32Array;
}

/** Footprint of the subject: splats within the sphere that framing has found, without the lowest hundredth. */
export function footprintOf(core: XrHost, positions: Float32Array, origin: Vector3): Footprint {
  const { center, radius } = core.camera.bounds;
  const { frame } = core;
  const kept = positions.slice();
  const heights: number[] = [];
  for (let at = 0; at < positions.length; at += 3) {
    const p: Vector3 = [positions[at] + origin[0], positions[at + 1] + origin[1], positions[at + 2] + origin[2]];
    const away = Math.hypot(p[0] - center[0], p[1] - center[1], p[2] - center[2]);
    if (away <= radius) heights.push(toViewer(frame, p)[1]);
    else kept.fill(NaN, at, at + 3);
  }
  const sorted = Float64Array.from(heights).sort();
  const low = sorted[Math.floor(BELOW * sorted.length)] ?? 0;
  const high = sorted[Math.floor((1 - BELOW) * (sorted.length - 1))] ?? 0;
  const [x, , z] = toViewer(frame, center);
  return { base: [x, low, z], height: high - low, radius, positions: kept };
}

/** Offers AR: WebXR if available, else the author's model on iPhones. */
export function offerAr(element: ReactiveControllerHost & HTMLElement, core: XrHost, place: HTMLElement): XrOffer {
  adoptStyles(element.shadowRoot!, AR_STYLES);
  const overlay = new ArOverlay(element, core);
  const offer = new XrOffer(element, core, place, arKind(core, overlay));
  overlay.onExit = () => offer.end();
  element.addController(new SimplifiedModel(element, core, place, offer));
  return offer;
}

const arKind = (core: XrHost, overlay: ArOverlay): XrKind => ({
  ...{ mode: 'immersive-ar', name: 'ar', word: 'ar' },
  isWanted: () => core.attributes.ar && /(^|\s)webxr(\s|$)/.test(core.attributes.arModes?.trim() || 'webxr'),
  options: () => ({
    requiredFeatures: ['hit-test'],
    optionalFeatures: ['anchors', 'local-floor', 'dom-overlay'],
    domOverlay: { root: overlay.root },
  }),
  spaces: ['local-floor', 'local'],
  guide: (started) => new ArGuide(core, started, overlay),
});

/** Places the subject at the hit point of the view ray with the room, and lets gestures move, turn and scale it. */
class ArGuide implements XrGuide {
  readonly background = [0, 0, 0, 0] as const;
  readonly #core: XrHost;
  readonly #of: XrStarted;
  readonly #overlay: ArOverlay;
  #shadow: { readonly splats: MarkerSplats; readonly half: number } | undefined;
  readonly #unit: number;
  #source: XrHitTestSource | undefined;
  #footprint: Footprint | undefined;
  #at: Vector3 | undefined;
  #turn = 0;
  #scale = 1;
  #anchor: XrAnchor | undefined;
  #isAnchored = false;
  #fingers: Fingers | undefined;
  #placed: Float64Array | undefined;

  constructor(core: XrHost, of: XrStarted, overlay: ArOverlay) {
    this.#core = core;
    this.#of = of;
    this.#overlay = overlay;
    const unit = unitOf(core);
    if (unit === undefined && core.attributes.arScale === 'fixed')
      core.warn(
        '<gaussian-splat> ar-scale="fixed": expected the attribute unit, such as unit="1m"; the object is 0.5 to 1 m large.',
      );
    this.#unit = unit ?? 1;
    overlay.show();
    of.signal.addEventListener('abort', () => {
      overlay.hide();
      this.#source?.cancel();
    });
    void this.#listen();
  }

  place(frame: XrFrame, pose: XrPose): Float64Array | null {
    const { loop } = this.#of.offer;
    const found = loop?.scene;
    if (!found) return null;
    if (!this.#footprint) {
      this.#footprint = footprintOf(this.#core, found.positions, found.origin);
      loop.crop(this.#footprint.positions);
      this.#scale = this.#firstScale(this.#footprint);
      this.#castShadow(found, this.#footprint).catch(({ message }: Error) => this.#core.warn(message));
    }
    if (!this.#at) this.#look(frame, pose);
    if (!this.#at) return null;
    this.#follow(frame);
    this.#touch(frame);
    return (this.#placed = this.#matrix(this.#at, this.#footprint));
  }

  drawAbove(room: Camera): void {
    if (!this.#placed) return;
    const worldToCamera = multiply(room.worldToCamera, this.#placed);
    this.#overlay.labels.place({ ...room, worldToCamera }, this.#core.frame);
  }

  drawBelow(
    camera: Parameters<NonNullable<XrGuide['drawBelow']>>[0],
    at: Parameters<NonNullable<XrGuide['drawBelow']>>[1],
  ): void {
    if (!this.#at || !this.#footprint || this.#isWall) return;
    if (!this.#shadow) return;
    const { splats, half } = this.#shadow;
    splats.draw(camera, at, placeOf(this.#at, half * this.#scale * this.#unit, this.#turn));
  }

  /** The same shadow as in the page, for the subject alone. */
  async #castShadow({ renderer }: XrScene, { positions, radius }: Footprint): Promise<void> {
    const { gl, signal } = this.#of;
    const { camera, frame, services, attributes } = this.#core;
    const kept = Uint32Array.from(positions.keys()).filter(
      (i) => 3 * i < positions.length && positions[3 * i] === positions[3 * i],
    );
    const { take, free } = alphaOfScene(gl, renderer, kept);
    const center = toViewer(frame, camera.bounds.center);
    const map = await takeShadow({ center, radius, frame }, take).finally(free);
    if (map === null || signal.aborted) return;
    const { intensity, softness } = readShadow(this.#core);
    const rows = shadowSplats(map, attributes.shadowIntensity ? intensity : 1, softness);
    const splats = new MarkerSplats(gl, rows, services.sceneLoader, signal);
    this.#shadow = { splats, half: map.half };
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

  /** First surface hit by the view ray. */
  #look(frame: XrFrame, pose: XrPose): void {
    const [hit] = (this.#source && frame.getHitTestResults?.(this.#source)) ?? [];
    const at = hit?.getPose(this.#of.space)?.transform;
    if (!at) return;
    const { x, y, z } = at.position;
    this.#at = [x, y, z];
    const viewer = pose.transform.position;
    const [towardX, towardZ] = this.#isWall ? [at.matrix[4], at.matrix[6]] : [viewer.x - x, viewer.z - z];
    // Turns its front, +z, to the person, or away from the wall.
    this.#turn = Math.atan2(towardX, towardZ);
    this.#source?.cancel();
    this.#source = undefined;
    this.#overlay.placed();
    this.#of.offer.status('object-placed');
    void this.#holdOn(hit);
  }

  async #holdOn(hit: XrHit): Promise<void> {
    const anchor = await hit.createAnchor?.().catch(() => undefined);
    this.#anchor = anchor;
    this.#isAnchored = anchor !== undefined;
  }

  /** Tracking of the room improves over time. */
  #follow(frame: XrFrame): void {
    if (!this.#isAnchored || !this.#anchor) return;
    const place = frame.getPose(this.#anchor.anchorSpace, this.#of.space)?.transform.position;
    if (place) this.#at = [place.x, place.y, place.z];
  }

  /** One finger moves the object on its plane, two turn and scale it. */
  #touch(frame: XrFrame): void {
    const touched = [...frame.session.inputSources].flatMap((input) => this.#onPlane(frame, input) ?? []);
    const fingers = touched.length > 0 ? fingersOf(touched) : undefined;
    const before = this.#fingers;
    this.#fingers = fingers;
    if (!fingers || !before || fingers.count !== before.count) return;
    this.#isAnchored = false;
    const [x, y, z] = this.#at!;
    this.#at = [x + fingers.x - before.x, y, z + fingers.z - before.z];
    if (fingers.count < 2) return;
    this.#turn -= fingers.angle - before.angle;
    if (this.#isFixed || before.apart === 0) return;
    this.#scale = Math.min(MAX_SCALE, Math.max(MIN_SCALE, (this.#scale * fingers.apart) / before.apart));
    if (this.#core.attributes.unit && Math.abs(this.#scale - 1) < SNAP) this.#scale = 1;
  }

  #onPlane(frame: XrFrame, input: XrInput & { targetRayMode?: string }): { x: number; z: number } | undefined {
    if (input.targetRayMode !== 'screen') return undefined;
    const m = frame.getPose(input.targetRaySpace, this.#of.space)?.transform.matrix;
    if (!m) return undefined;
    const far = (m[13] - this.#at![1]) / m[9];
    return far > 0 ? { x: m[12] - far * m[8], z: m[14] - far * m[10] } : undefined;
  }

  #matrix([x, y, z]: Vector3, { base, height, radius }: Footprint): Float64Array {
    const size = this.#scale;
    const [sin, cos] = [size * Math.sin(this.#turn), size * Math.cos(this.#turn)];
    const meters = metersOf(this.#core.frame, this.#unit);
    // The center of its base is placed there; on a wall, the center of its back.
    const [lift, back] = this.#isWall ? [height / 2, -radius] : [0, 0];
    const [px, py, pz] = [base[0], base[1] + lift, base[2] + back].map((value) => value * this.#unit);
    const turn = [cos, 0, sin, x, 0, size, 0, y, -sin, 0, cos, z, 0, 0, 0, 1];
    const move = [1, 0, 0, -px, 0, 1, 0, -py, 0, 0, 1, -pz, 0, 0, 0, 1];
    return Float64Array.from(multiply(multiply(turn, move), meters));
  }
}

interface Fingers {
  readonly count: number;
  readonly x: number;
  readonly z: number;
  readonly angle: number;
  readonly apart: number;
}

function fingersOf(places: readonly { readonly x: number; readonly z: number }[]): Fingers {
  const [a, b = a] = places;
  const [dx, dz] = [b.x - a.x, b.z - a.z];
  const middle = { x: (a.x + b.x) / 2, z: (a.z + b.z) / 2 };
  return { count: Math.min(2, places.length), ...middle, angle: Math.atan2(dz, dx), apart: Math.hypot(dx, dz) };
}
