import { loadModule, type Vector3 } from '@gaussian-splat/core';
import type { ReactiveController } from 'lit';
import { eyeOfPose } from '../../viewer/camera/orbit.js';
import type { Feature } from '../../viewer/features.js';
import { visitorMessage } from '../../viewer/errors.js';
import { unitOf } from '../../viewer/unit.js';
import type { Viewer } from '../../viewer/viewer.js';
import { mapUrlOf, setMapUrl } from '../../floor/floor-source.js';
import { kindOf } from '../../sources/source-kinds.js';
import { Ahead } from './ahead.js';
import { addressOf, arrivalAt, backOf, readDoors, type Arrival, type Door } from './rooms.js';
import type { FloorPlan } from './floor-plan.js';

/** Horizontal distance from a door, meters, at which visitors go through it, and beyond which doors open again after an arrival. */
const [THROUGH, AWAY] = [0.6, 0.8];
/** Distance between two frames, meters, beyond which the visitor was put somewhere and did not walk. */
const JUMP = 1;

/** Files that name others, which are found beside their own address alone. */
const HAS_PARTS = /\.(json|gltf|lcc2?)$/i;

/** A visitor who is on the way to a room. */
interface Passing {
  readonly room: string;
  /** Fraction of the file of the room that has arrived, 0..1, while it is waited for; null while unknown. */
  progress: number | null | undefined;
}

/** Leads from scene to scene through doors, and fetches the scenes behind those of the present room. */
export class Doors implements ReactiveController, Feature {
  readonly #viewer: Viewer;
  #doors: readonly Door[] = [];
  /** Address of the scene that the page has set, of the scene that is shown, and map of the floor of the first. */
  #first = '';
  #firstMap: string | null = null;
  #room = '';
  /** Value of `src` that is known here: an address, or the file of a room that was fetched ahead. */
  #src: string | Blob | null | undefined;
  /** Value of `src` with which the present room is shown. */
  #srcOfRoom: string | Blob | null | undefined;
  readonly #ahead: Ahead;
  #passing: Passing | undefined;
  #arrival: Arrival | undefined;
  /** Whether the visitor is far enough from all doors to go through one. */
  #isAway = false;
  /** Position of the visitor in the frame before, viewer space in meters. */
  #eye: Vector3 | undefined;
  /** Attributes of the pose: what the page has set, and what the last arrival has put there. */
  readonly #pose = new Map<string, { readonly authored: string | null; readonly own: string }>();
  /** Map of the floor that was set last for a room; undefined for none. */
  #map: string | null | undefined;
  #plan: FloorPlan | undefined;

  constructor(viewer: Viewer) {
    this.#viewer = viewer;
    this.#ahead = new Ahead(viewer.warnOf);
    const { element } = viewer;
    element.addEventListener('click', this.#onClick);
    element.addEventListener('load', () => {
      if (this.#passing) return;
      this.#fetchAhead();
      this.#showPlan();
    });
    element.addController(this);
  }

  childrenChanged(): void {
    if (this.#first === '') return;
    this.#doors = readDoors(this.#viewer.element, this.#first, this.#viewer.warn);
    this.#showDoors();
    this.#fetchAhead();
  }

  hostConnected(): void {
    this.#fetchAhead();
  }

  hostUpdated(): void {
    const { attributes, warnOf, source } = this.#viewer;
    if (source.src !== this.#src) this.#pageShows((this.#src = source.src));
    if (!attributes.floorPlan) return this.#removePlan();
    if (this.#plan) return;
    loadModule('the code of the plan', () => import('./floor-plan.js')).then(({ FloorPlan }) => {
      if (this.#plan || !this.#viewer.attributes.floorPlan) return;
      this.#plan = new FloorPlan(this.#viewer, (room) => void this.#enter(room));
      this.#showPlan();
    }, warnOf);
  }

  hostDisconnected(): void {
    this.#ahead.stop();
    this.#removePlan();
  }

  /** A session in a headset continues behind the door. */
  keepsSession(): true | undefined {
    return this.#passing && true;
  }

  progress(): number | null | undefined {
    return this.#passing?.progress;
  }

  headMoved(head: Vector3): void {
    this.#visitorAt(head);
  }

  cameraMoved(): void {
    const { camera, navigation } = this.#viewer;
    const eye = eyeOfPose(camera.goal);
    this.#plan?.move(eye, camera.goal.theta);
    const unit = unitOf(this.#viewer) ?? 1;
    if (navigation === 'orbit') return;
    const [x, y, z] = [eye[0] * unit, eye[1] * unit, eye[2] * unit];
    const last = this.#eye;
    this.#eye = [x, y, z];
    if (!last || Math.hypot(x - last[0], z - last[2]) > JUMP) this.#isAway = false;
    this.#visitorAt(this.#eye);
  }

  /** Goes through the door that a visitor has reached. @param eye Viewer space in meters. */
  #visitorAt(eye: Vector3): void {
    if (this.#passing) return;
    const near = this.#nearest(eye);
    if (near === undefined) return;
    if (near.distance > AWAY) this.#isAway = true;
    else if (near.distance < THROUGH && this.#isAway) void this.pass(near.door);
  }

  /** The first frame of a room is drawn from its door. */
  async prepareFor(): Promise<void> {
    // Also of a preview: the doors are those of the room before.
    if (this.#passing) this.#showDoors(true);
    const arrival = this.#arrival;
    if (!arrival) return;
    this.#arrival = undefined;
    const { element } = this.#viewer;
    const { eye, heading } = arrival;
    // One meter before the eyes, so that the view turns about the visitor.
    const reach = 1 / (unitOf(this.#viewer) ?? 1);
    const target = [eye[0] - reach * Math.sin(heading), eye[1], eye[2] - reach * Math.cos(heading)];
    this.#setPose('camera-orbit', `${heading}rad 90deg ${reach}m`);
    this.#setPose('camera-target', target.map((value) => `${value}m`).join(' '));
    await element.updateComplete;
  }

  #setPose(name: string, own: string): void {
    const { element } = this.#viewer;
    const [present, before] = [element.getAttribute(name), this.#pose.get(name)];
    this.#pose.set(name, { authored: before && present === before.own ? before.authored : present, own });
    element.setAttribute(name, own);
  }

  #setMap(url: string | null): void {
    this.#map = url;
    setMapUrl(this.#viewer, url);
  }

  /** Goes through a door. Resolves when the scene behind it is shown, or has failed. */
  async pass(door: Door): Promise<void> {
    const back = backOf(door, this.#doors);
    await this.#enter(door.to, back && arrivalAt(back, unitOf(this.#viewer) ?? 1), door.floorMap);
  }

  /** Takes what the page has set as `src`, and with it the place of doors that name no room, unless that is a room of the tour. */
  #pageShows(src: string | Blob | null | undefined): void {
    this.#passing = this.#arrival = undefined;
    if (!src) return;
    const { element, sources } = this.#viewer;
    this.#srcOfRoom = src;
    this.#room = typeof src === 'string' ? addressOf(src, element) : sources.ownEntry.scene.url;
    for (const [name, { authored, own }] of this.#pose) {
      if (element.getAttribute(name) !== own) continue;
      if (authored === null) element.removeAttribute(name);
      else element.setAttribute(name, authored);
    }
    this.#pose.clear();
    const isOfTour = this.#doors.some(({ room, to }) => room === this.#room || to === this.#room);
    const map = mapUrlOf(this.#viewer);
    const isOwn = this.#map !== undefined && this.#map === map;
    if (!isOfTour) [this.#first, this.#firstMap] = [this.#room, isOwn ? null : map];
    if (isOwn) this.#setMap(this.#mapOf(this.#room));
    this.childrenChanged();
  }

  /** The latest door wins: a visitor who waits for a room may choose another. */
  async #enter(room: string, arrival?: Arrival, floorMap = this.#mapOf(room)): Promise<void> {
    const { element, sources, announcer, camera, surface } = this.#viewer;
    const { scene } = sources.ownEntry;
    if (room === (this.#passing?.room ?? (scene.error ? undefined : this.#room))) return;
    const passing: Passing = { room, progress: this.#ahead.isFetching(room) ? null : undefined };
    this.#passing = passing;
    this.#isAway = false;
    const [from, door] = [this.#room, this.#doors.find((each) => each.to === room)];
    const entry = door && backOf(door, this.#doors);
    const hasFocus = this.#doors.some((each) => each.element === element.ownerDocument.activeElement);
    const here: Arrival = { eye: eyeOfPose(camera.goal), heading: camera.goal.theta };
    element.requestUpdate();
    const file = await this.#ahead.take(room, (loaded, total) => {
      passing.progress = total ? loaded / total : null;
      element.requestUpdate();
    });
    passing.progress = undefined;
    if (this.#passing !== passing) return;
    if (!element.isConnected) return void (this.#passing = undefined);
    this.#arrival = arrival ?? (entry && arrivalAt(entry, unitOf(this.#viewer) ?? 1));
    this.#setMap(floorMap);
    // The same address again, after an error.
    if (this.#src === (file ?? room)) sources.ownEntry.reload();
    Object.assign(element, { src: (this.#src = file ?? room) });
    await element.updateComplete;
    await scene.settled;
    if (this.#passing !== passing) return;
    this.#passing = undefined;
    // The keyboard continues from the frame, because the door is hidden.
    if (hasFocus) surface?.focus({ preventScroll: true });
    if (scene.error) return this.#goBack(room, here);
    [this.#room, this.#srcOfRoom] = [room, this.#src];
    this.#showDoors();
    if (!element.isConnected) return;
    announcer.value?.say(door?.element.textContent?.trim() ?? '');
    element.dispatchEvent(new CustomEvent('room-change', { detail: { url: room, from } }));
    this.#fetchAhead();
  }

  /** Shows the room again from which a visitor comes, because the one behind the door has failed. */
  #goBack(failed: string, here: Arrival): void {
    const { element, sources, announcer, strings } = this.#viewer;
    const { error } = sources.ownEntry.scene;
    this.#ahead.forget(failed);
    this.#arrival = here;
    this.#setMap(this.#mapOf(this.#room));
    this.#showDoors();
    Object.assign(element, { src: (this.#src = this.#srcOfRoom) });
    if (error) announcer.value?.say(visitorMessage(error, strings));
  }

  /** Map of the floor of a room: that of any door that leads there. */
  #mapOf(room: string): string | null {
    if (room === this.#first) return this.#firstMap;
    return this.#doors.find(({ to, floorMap }) => to === room && floorMap !== null)?.floorMap ?? null;
  }

  /** Shows the doors of the present room alone; none between two rooms. */
  #showDoors(isBetween = false): void {
    for (const { element, room } of this.#doors) element.hidden = isBetween || room !== this.#room;
    this.#showPlan();
  }

  /** Draws the plan. Maps are read with the request of the scene, so that this waits for the first one. */
  #showPlan(): void {
    const { shownRequest } = this.#viewer.sources.ownEntry.scene;
    if (shownRequest) this.#plan?.show(this.#first, this.#firstMap, this.#doors, this.#room);
  }

  /** Fetches the files behind the doors of the present room. */
  #fetchAhead(): void {
    const { sources, services } = this.#viewer;
    const { state, shownRequest: request } = sources.ownEntry.scene;
    if (state !== 'ready' || !request || this.#passing) return;
    const { credentials, limits } = request;
    // A streamed room fetches what its view needs.
    const isFile = (url: string): boolean =>
      /^https?:/.test(url) &&
      URL.canParse(url) &&
      !HAS_PARTS.test(new URL(url).pathname) &&
      kindOf({ ...request, url, file: undefined }).name === 'file';
    const rooms = this.#doors.filter(({ room }) => room === this.#room).map(({ to }) => to);
    this.#ahead.want(rooms.filter(isFile), (url, signal, onProgress) => {
      const address = services.urlModifier?.(url) ?? url;
      return services.sceneLoader.fetchFile({ url: address, credentials, limits }, signal, onProgress);
    });
  }

  /** Returns the door of the present room that is nearest to a point, and its horizontal distance, meters. */
  #nearest([x, , z]: Vector3): { door: Door; distance: number } | undefined {
    const unit = unitOf(this.#viewer) ?? 1;
    let nearest: { door: Door; distance: number } | undefined;
    for (const door of this.#doors) {
      if (door.room !== this.#room) continue;
      const distance = Math.hypot(x - unit * door.position[0], z - unit * door.position[2]);
      if (!nearest || distance < nearest.distance) nearest = { door, distance };
    }
    return nearest;
  }

  readonly #onClick = (event: MouseEvent): void => {
    const door = this.#doors.find(({ element }) => element.contains(event.target as Node));
    // A link opens in another tab if the visitor asks for that.
    if (!door || event.ctrlKey || event.metaKey || event.shiftKey) return;
    event.preventDefault();
    void this.pass(door);
  };

  #removePlan(): void {
    this.#plan?.remove();
    this.#plan = undefined;
  }
}
