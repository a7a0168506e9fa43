import { GaussianSplatError, loadModule, type Vector3 } from '@gaussian-splat/core';
import type { ReactiveController } from 'lit';
import { eyeOfPose } from '../../viewer/camera/orbit.js';
import type { Feature } from '../../viewer/features.js';
import { unitOf } from '../../viewer/unit.js';
import type { Viewer } from '../../viewer/viewer.js';
import { mapUrlOf, setMapUrl } from '../../floor/floor-source.js';
import { keyOf } from '../../loading/scene-loader.js';
import type { ProgressListener, SceneRequest } from '../../loading/protocol.js';
import { kindOf } from '../../sources/source-kinds.js';
import { arrivalAt, backOf, readDoors, type Arrival, type Door } from './rooms.js';
import type { FloorPlan } from './floor-plan.js';

/** Horizontal distance from a door, meters, at which visitors go through it, and beyond which doors open again after an arrival. */
const [THROUGH, AWAY] = [0.6, 0.8];

/** Maximum size of the files that were fetched ahead, bytes. */
const MAX_BYTES = 64e6;

interface Fetching {
  readonly url: string;
  readonly controller: AbortController;
}

/** Leads from scene to scene through doors, and fetches the scenes behind those of the present room. */
export class Doors implements ReactiveController, Feature {
  readonly #viewer: Viewer;
  #doors: readonly Door[] = [];
  /** URL of the scene that the page names, of the scene that is shown, and map of the floor of the first. */
  #first = '';
  #firstMap: string | null = null;
  #room = '';
  /** URL of the scene that this class has requested last. */
  #shownUrl = '';
  /** Files that were fetched ahead, in this order: their keys of the loader by URL, and their sizes in bytes. */
  readonly #files = new Map<string, { key: string; size: number }>();
  /** The file that is being fetched ahead. A visitor who goes through its door waits for the rest of it. */
  #fetching: Fetching | undefined;
  #arrival: Arrival | undefined;
  /** Whether the visitor is far enough from all doors to go through one. */
  #isAway = false;
  #isPassing = false;
  #plan: FloorPlan | undefined;

  constructor(viewer: Viewer) {
    this.#viewer = viewer;
    const { element } = viewer;
    element.addEventListener('click', this.#onClick);
    element.addEventListener('load', () => {
      if (this.#isPassing) return;
      this.#fetchAhead();
      this.#showPlan();
    });
    // The loader is the page's, so that it would keep the files of an element that was removed for good.
    element.addEventListener('emptied', () => {
      if (!element.isConnected) for (const url of this.#files.keys()) this.#forget(url);
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
    const { attributes, warnOf, sources } = this.#viewer;
    const { url } = sources.ownEntry.scene;
    // The page has set another scene.
    if (url !== '' && url !== this.#shownUrl && !this.#isPassing) {
      this.#shownUrl = this.#room = url;
      if (this.#first === '') [this.#first, this.#firstMap] = [url, mapUrlOf(this.#viewer)];
      this.childrenChanged();
    }
    if (!attributes.floorPlan) return this.#removePlan();
    if (this.#plan) return;
    loadModule('the code of the plan', () => import('./floor-plan.js')).then(({ FloorPlan }) => {
      if (this.#plan || !this.#viewer.attributes.floorPlan) return;
      this.#plan = new FloorPlan(this.#viewer, (room) => void this.#enter(room));
      this.#showPlan();
    }, warnOf);
  }

  hostDisconnected(): void {
    this.#stop();
    this.#removePlan();
  }

  /** A session in a headset continues behind the door. */
  keepsSession(): true | undefined {
    return this.#isPassing || undefined;
  }

  headMoved(head: Vector3): void {
    this.#visitorAt(head);
  }

  cameraMoved(): void {
    const { camera, navigation } = this.#viewer;
    const eye = eyeOfPose(camera.goal);
    this.#plan?.move(eye, camera.goal.theta);
    const unit = unitOf(this.#viewer) ?? 1;
    if (navigation !== 'orbit') this.#visitorAt([eye[0] * unit, eye[1] * unit, eye[2] * unit]);
  }

  /** Goes through the door that a visitor has reached. @param eye Viewer space in meters. */
  #visitorAt(eye: Vector3): void {
    if (this.#isPassing) return;
    const near = this.#nearest(eye);
    if (near === undefined) return;
    if (near.distance > AWAY) this.#isAway = true;
    else if (near.distance < THROUGH && this.#isAway) void this.pass(near.door);
  }

  /** The first frame of a room is drawn from its door. */
  async prepareFor(): Promise<void> {
    const arrival = this.#arrival;
    if (!arrival) return;
    this.#arrival = undefined;
    const { element } = this.#viewer;
    const { eye, heading } = arrival;
    // One meter before the eyes, so that the view turns about the visitor.
    const reach = 1 / (unitOf(this.#viewer) ?? 1);
    const target = [eye[0] - reach * Math.sin(heading), eye[1], eye[2] - reach * Math.cos(heading)];
    element.setAttribute('camera-orbit', `${heading}rad 90deg ${reach}m`);
    element.setAttribute('camera-target', target.map((value) => `${value}m`).join(' '));
    await element.updateComplete;
  }

  /** Goes through a door. Resolves when the scene behind it is shown, or has failed. */
  async pass(door: Door): Promise<void> {
    const back = backOf(door, this.#doors);
    await this.#enter(door.to, back && arrivalAt(back, unitOf(this.#viewer) ?? 1), door.floorMap);
  }

  async #enter(room: string, arrival?: Arrival, floorMap = this.#mapOf(room)): Promise<void> {
    if (this.#isPassing || room === this.#room) return;
    this.#isPassing = true;
    this.#isAway = false;
    if (this.#fetching?.url !== room) this.#stop();
    const { element, sources, announcer } = this.#viewer;
    const [from, door] = [this.#room, this.#doors.find((each) => each.to === room)];
    const entry = door && backOf(door, this.#doors);
    this.#arrival = arrival ?? (entry && arrivalAt(entry, unitOf(this.#viewer) ?? 1));
    setMapUrl(this.#viewer, floorMap);
    Object.assign(element, { src: room });
    await element.updateComplete;
    const { scene } = sources.ownEntry;
    await scene.settled;
    this.#isPassing = false;
    this.#room = room;
    this.#shownUrl = scene.url;
    this.#showDoors();
    if (scene.error || !element.isConnected) return;
    announcer.value?.say(door?.element.textContent?.trim() ?? '');
    element.dispatchEvent(new CustomEvent('room-change', { detail: { url: room, from } }));
    this.#fetchAhead();
  }

  /** Map of the floor of a room: that of any door that leads there. */
  #mapOf(room: string): string | null {
    if (room === this.#first) return this.#firstMap;
    return this.#doors.find(({ to, floorMap }) => to === room && floorMap !== null)?.floorMap ?? null;
  }

  /** Shows the doors of the present room alone. */
  #showDoors(): void {
    for (const { element, room } of this.#doors) element.hidden = room !== this.#room;
    this.#showPlan();
  }

  /** Draws the plan. Maps are read with the request of the scene, so that this waits for the first one. */
  #showPlan(): void {
    const { shownRequest } = this.#viewer.sources.ownEntry.scene;
    if (shownRequest) this.#plan?.show(this.#first, this.#firstMap, this.#doors, this.#room);
  }

  /** Fetches the files behind the doors of the present room, one after the other. One that is on its way stays so. */
  #fetchAhead(): void {
    const { state, shownRequest: request } = this.#viewer.sources.ownEntry.scene;
    if (state !== 'ready' || !request || this.#isPassing) return;
    const rooms = this.#doors.filter(({ room }) => room === this.#room).map(({ to }) => to);
    if (this.#fetching && rooms.includes(this.#fetching.url)) return;
    this.#stop();
    // A streamed room fetches what its view needs.
    const isFile = (url: string): boolean =>
      /^https?:/.test(url) && kindOf({ ...request, url, file: undefined }).name === 'file';
    const url = rooms.find((room) => !this.#files.has(room) && isFile(room));
    if (url !== undefined) void this.#fetch((this.#fetching = { url, controller: new AbortController() }), request);
  }

  #stop(): void {
    this.#fetching?.controller.abort();
    this.#fetching = undefined;
  }

  async #fetch(fetching: Fetching, { credentials, limits }: SceneRequest): Promise<void> {
    const { services, warn } = this.#viewer;
    const { url, controller } = fetching;
    const key = keyOf({ url, credentials });
    let listener: ProgressListener | undefined;
    const bytes = services.sceneLoader.fetchFile({ url, credentials, limits }, controller.signal, (...progress) =>
      listener?.(...progress),
    );
    const content = bytes.then(
      (whole) => new Blob([whole]),
      () => undefined,
    );
    services.sceneLoader.ahead.set(key, (onProgress) => ((listener = onProgress), content));
    const file = { key, size: 0 };
    this.#files.set(url, file);
    try {
      file.size = (await bytes).byteLength;
      this.#evict();
    } catch (error) {
      // A visitor who goes through the door has the scene requested again, whose error is shown.
      if (this.#files.get(url) === file) this.#forget(url);
      if (!controller.signal.aborted && error instanceof GaussianSplatError) warn(error.message);
    }
    if (this.#fetching !== fetching) return;
    this.#fetching = undefined;
    if (this.#files.has(url)) this.#fetchAhead();
  }

  /** Forgets the files that were fetched first while all together are too large. */
  #evict(): void {
    const sizeOf = (): number => [...this.#files.values()].reduce((sum, { size }) => sum + size, 0);
    for (const url of this.#files.keys()) if (this.#files.size > 1 && sizeOf() > MAX_BYTES) this.#forget(url);
  }

  #forget(url: string): void {
    const file = this.#files.get(url);
    if (file) this.#viewer.services.sceneLoader.ahead.delete(file.key);
    this.#files.delete(url);
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
