import { loadModule, multiply, type Camera, type Matrix4 } from '@gaussian-splat/core';
import { boundsOfWorld, type FrameTarget, type ProbeAnswer, type ProbePoint } from '@gaussian-splat/renderer';
import type { ViewerFrame } from '../camera/orbit.js';
import { frameOf, type SceneBounds } from '../camera/settings.js';
import type { MotionHost } from '../controllers/motion-controller.js';
import { prefersReducedMotion } from '../controllers/motion-controller.js';
import type { PlaybackController } from '../controllers/playback-controller.js';
import type { Entrance, SceneState } from '../controllers/scene-controller.js';
import type { ElementError } from '../errors.js';
import type { DetailLevers, LoadedGaussians } from '../gpu/loaded-gaussians.js';
import type { Place } from '../gpu/painter.js';
import type * as meshes from '../meshes/open-mesh.js';
import type { Frame } from '../live/frame-filter.js';
import type { Stage } from '../stage.js';
import type { PartStats, SceneStats } from '../stats.js';
import type { Member } from '../member.js';
import { credentialsOf } from '../attributes.js';
import type { SceneSlot } from './scene-slot.js';
import { costOf, type MeshDrawing, type Part, type PlacedModel } from './part.js';

/** From a glTF's axes, y up, to those of the cloud that its splats are read as. */
const GLTF_TO_CLOUD: Matrix4 = [-1, 0, 0, 0, 0, -1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1];
const IDENTITY: Matrix4 = [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1];

const loadMeshes = (): Promise<typeof meshes> =>
  loadModule('the code that shows meshes', () => import('../meshes/open-mesh.js'));

/** States from the one that says most of several parts on. */
const STATES: readonly SceneState[] = ['ready', 'loading', 'waiting', 'failed'];

/** Shows the scenes and meshes of an element's children beside its own scene. */
export class Composition {
  readonly stage: Stage;
  /** What draws meshes, where there are some. */
  #meshes: MeshDrawing | undefined;
  readonly #parts = new Set<Part>();
  /** Parts come one after the other, so that one that fails is known. */
  #arrivals: Promise<void> | undefined;
  #preparing = Promise.resolve();
  #latest: Part | Stage | undefined;
  #isFramed = false;
  #isToldLoaded = false;
  readonly #lost = new Set<object>();

  constructor(stage: Stage) {
    this.stage = stage;
    const { own } = stage;
    this.#isFramed = own !== undefined;
    if (own?.scene.hasMeshes) void this.#addMeshes(stage, own.scene);
  }

  // The parts.

  add(part: Part): void {
    this.#parts.add(part);
    this.#changed();
  }

  remove(part: Part): void {
    this.#parts.delete(part);
    part.leave();
    if (this.tellsContext('contextrestored', part)) this.stage.dispatch(new Event('contextrestored'));
    this.left(true);
    this.#changed();
  }

  /**
   * Shows what a part has loaded, once those before it are drawn. Fulfils when it is, or need not be any more; rejects with GaussianSplatError `out-of-memory/*`.
   * @param enter puts it into the world; false where it is not wanted any more
   */
  #arrive(part: Part | Stage, scene: LoadedGaussians, entrance: Entrance, enter: () => boolean): Promise<void> {
    const show = async (): Promise<void> => {
      if (scene.model) await this.#prepareMeshes(scene);
      if (scene.isDestroyed || scene.isLost || !enter()) return;
      if (scene.hasMeshes) void this.#addMeshes(part, scene);
      this.#latest = part;
      this.#frame(entrance, part === this.stage);
      await this.#draw(scene);
    };
    const shown = this.#arrivals ? this.#arrivals.then(show) : show();
    const over = shown
      .catch(() => undefined)
      .then(() => {
        if (this.#arrivals === over) this.#arrivals = undefined;
      });
    this.#arrivals = over;
    return shown;
  }

  /** Shows the splats that a part has loaded. */
  join(part: Part, scene: LoadedGaussians, entrance: Entrance, enter: (member: Member) => void): Promise<void> {
    return this.#arrive(part, scene, entrance, () => {
      const isWanted = this.#parts.has(part) && part.source === scene;
      if (isWanted) enter(this.stage.enter(scene));
      return isWanted;
    });
  }

  /** Something is shown no more: draws what is left, or nothing. */
  left(clear: boolean): void {
    this.stage.splatsChanged();
    if (this.#isEmpty) {
      if (clear) this.#isToldLoaded = this.#isFramed = false;
      this.stage.stopDrawing(clear);
    }
    if (this.members.some(({ scene }) => scene.model)) return;
    this.#meshes?.destroy();
    this.#meshes = undefined;
  }

  /** Meshes that are drawn, and where. */
  get #models(): readonly PlacedModel[] {
    return this.members.flatMap(({ scene, placement }) => {
      const { model, hasMeshes } = scene;
      if (!model || !placement.visible) return [];
      const { sceneToWorld = IDENTITY } = placement;
      return [{ model, toWorld: hasMeshes ? multiply(sceneToWorld, GLTF_TO_CLOUD) : sceneToWorld }];
    });
  }

  /** Makes what draws meshes on a device: once, whoever asks. */
  #prepareMeshes({ device }: LoadedGaussians): Promise<void> {
    const prepare = async (): Promise<void> => {
      const { MeshLayer } = await loadMeshes();
      if (this.#meshes?.device === device) return;
      this.#meshes?.destroy();
      this.#meshes = undefined;
      this.#meshes = await MeshLayer.create(device);
    };
    const prepared = this.#preparing.then(prepare);
    this.#preparing = prepared.catch(() => undefined);
    return prepared;
  }

  /** The triangles of a file that has splats, too: they come after these, and what is wrong with them leaves the splats visible. */
  async #addMeshes(part: Part | Stage, scene: LoadedGaussians): Promise<void> {
    const { stage } = this;
    const { attributes, services } = part === stage ? stage : (part as SceneSlot);
    const url = part === stage ? stage.scene.url : (part as Part).url;
    try {
      const { openModel } = await loadMeshes();
      const { signal } = new AbortController();
      const request = { url, credentials: credentialsOf(attributes.crossorigin), limits: services.sceneLimits };
      const frameUrl = (beside: string): string => services.urlModifier?.(beside) ?? beside;
      const model = await openModel(request, { loader: services.sceneLoader, signal, frameUrl });
      await this.#prepareMeshes(scene);
      if (scene.isDestroyed) return model.dispose();
      scene.model = model;
      this.#frame('whole', false);
      this.#changed();
    } catch (error) {
      if (!scene.isDestroyed) stage.warn(`<gaussian-splat>: the triangles are not shown: ${(error as Error).message}`);
    }
  }

  async #draw(place: Place): Promise<void> {
    const { view, live } = this.stage;
    const before = view.painter;
    const drawn = view.show(place);
    if (view.painter !== before) live.post.attach(view.painter);
    await drawn;
  }

  #frame(entrance: Entrance, isOwn: boolean): void {
    const { bounds } = this;
    if (entrance === 'again' || bounds === null) return;
    const { camera } = this.stage;
    if (!this.#isFramed || (isOwn && entrance === 'new')) camera.frame(bounds);
    else camera.refine(bounds);
    this.#isFramed = true;
  }

  /** A part is shown, or cannot be. */
  partSettled(): void {
    this.#changed();
    const { scene } = this.stage;
    // The events of an element without a scene of its own are those of its children together.
    const isOver = [...this.#parts].every(({ state }) => state !== 'loading' && state !== 'waiting');
    if (scene.state !== 'empty' || !isOver || this.#isToldLoaded) return;
    const shown = [...this.#parts].find(({ state }) => state === 'ready');
    this.#isToldLoaded = shown !== undefined;
    if (shown) this.stage.loaded(shown.url);
    else if (this.error) this.stage.failed(this.error);
  }

  /** All that is in the world. */
  get members(): readonly Member[] {
    const { own } = this.stage;
    return [...(own ? [own] : []), ...[...this.#parts].flatMap(({ member }) => member ?? [])];
  }

  get #isEmpty(): boolean {
    return this.stage.own === undefined && ![...this.#parts].some(({ isEntered }) => isEntered);
  }

  #changed(): void {
    this.#setDuration();
    this.stage.splatsChanged();
  }

  /** The element's clock goes as far as its own scene, or else as what follows it. */
  #setDuration(): void {
    const { scene, playback, own } = this.stage;
    if (own === undefined && (scene.state === 'waiting' || scene.state === 'loading')) return;
    // What has gone with a device comes back, and its time goes on.
    if (this.#lost.size > 0) return;
    const couldPlay = playback.canPlay;
    const duration = own?.scene.live?.duration ?? NaN;
    const followed = [...this.#parts].flatMap((part) => (part.hasOwnClock ? [] : [part.duration]));
    const moving = followed.filter((seconds) => !Number.isNaN(seconds));
    playback.setDuration(Number.isNaN(duration) && moving.length > 0 ? Math.max(...moving) : duration);
    // What follows the clock may come when the poster has gone.
    if (!couldPlay && playback.canPlay && this.stage.isOnShow) this.stage.autoplay();
  }

  /** What plays by itself may begin. */
  get mayAutoplay(): boolean {
    return this.stage.isOnShow && !prefersReducedMotion() && !this.stage.behaviours.motion.isHeld;
  }

  /** Rotation from the world, the frame of the element's own scene, to viewer space. */
  get frame(): ViewerFrame {
    return frameOf(this.stage.attributes, { up: this.stage.own?.scene.bounds.up });
  }

  // What the stage asks.

  get state(): SceneState {
    const own = this.stage.scene.state;
    if (own !== 'empty' && own !== 'failed') return own;
    const states = [...this.#parts].map(({ state }) => state);
    return STATES.find((state) => states.includes(state)) ?? own;
  }

  get error(): ElementError | null {
    const { error, state } = this.stage.scene;
    if (error || state !== 'empty' || this.state !== 'failed') return error;
    return [...this.#parts].find((part) => part.error)?.error ?? null;
  }

  get settled(): Promise<unknown> {
    return Promise.all([...this.#parts].map(({ settled }) => settled));
  }

  /** @param own that of the element's own scene */
  progressWith(own: number | null): number | null {
    const { scene } = this.stage;
    const all = [{ state: scene.state, progress: own }, ...this.#parts].filter(
      ({ state }) => state !== 'empty' && state !== 'failed',
    );
    const shares = all.map(({ state, progress }) => (state === 'ready' ? 1 : progress));
    const known = shares.filter((share) => share !== null);
    return known.length > 0 ? known.reduce((sum, share) => sum + share, 0) / shares.length : null;
  }

  get hasPicture(): boolean {
    return [...this.#parts].some(({ isShown }) => isShown);
  }

  get levels(): DetailLevers {
    const all = this.members.map(({ scene }) => scene.detail);
    const most = (of: (levers: DetailLevers) => number | undefined): number =>
      Math.max(0, ...all.map((each) => of(each) ?? 0));
    return { detail: most(({ detail }) => detail), splatBudget: most(({ splatBudget }) => splatBudget) };
  }

  /** Puts all parts where they are. @returns what changes whenever meshes do */
  prepareFrame(): string {
    for (const part of this.#parts) part.place();
    return this.#models.map(({ model }) => model.version).join();
  }

  drawBeneath(frame: Frame): Partial<FrameTarget> {
    const models = this.#models;
    return this.#meshes && models.length > 0 ? this.#meshes.draw(frame, models, this.frame) : {};
  }

  get bounds(): SceneBounds | null {
    for (const part of this.#parts) part.place();
    const bounds = boundsOfWorld(this.stage.world);
    return bounds ? { ...bounds, up: this.stage.own?.scene.bounds.up } : null;
  }

  async readBounds(): Promise<SceneBounds | null> {
    await Promise.all(
      this.members.map(async (member) => {
        const bounds = await member.scene.live?.readBounds?.();
        if (bounds) member.placement.bounds = bounds;
      }),
    );
    return this.bounds;
  }

  /** @param own the clock of the element, where it plays by itself */
  playerWith(own: PlaybackController | undefined): MotionHost['player'] {
    const clocks = [...this.#parts].flatMap(({ autoplays, ownClock }) => (autoplays ? [ownClock] : []));
    if (own) clocks.push(own);
    if (clocks.length === 0) return undefined;
    const playable = clocks.filter(({ canPlay }) => canPlay);
    return {
      canPlay: playable.length > 0,
      paused: playable.every(({ paused }) => paused),
      play: () => playable.forEach((clock) => clock.play()),
      pause: () => playable.forEach((clock) => clock.pause()),
    };
  }

  autoplay(): void {
    for (const part of this.#parts) part.autoplay();
  }

  show(scene: LoadedGaussians, entrance: Entrance): Promise<void> {
    const { stage } = this;
    return this.#arrive(stage, scene, entrance, () => {
      stage.own?.remove();
      stage.own = stage.enter(scene);
      this.#changed();
      return true;
    });
  }

  hide(clear: boolean): void {
    this.stage.own?.remove();
    this.stage.own = undefined;
    this.left(clear);
  }

  advance(camera: Camera, now: number): void {
    // Its own scene may stand still while others follow the element's clock.
    this.stage.playback.tick(now);
    for (const part of this.#parts) part.advance(camera, now);
  }

  suspend(): void {
    for (const { ownClock } of this.#parts) ownClock.suspend();
  }

  /** What came last was too much; whatever else it was, what is left is tried again. */
  fail(error: unknown): void {
    const entered = [...this.#parts].filter((part) => part.isEntered);
    const latest = entered.find((part) => part === this.#latest);
    const { own, scene } = this.stage;
    const blamed = latest ?? (own ? undefined : entered.at(-1));
    this.#latest = undefined;
    if (blamed) blamed.fail(error);
    else if (own) scene.fail(error);
  }

  /** Ends what was found of splats where a mesh is nearer. */
  async probe(points: readonly ProbePoint[], answers: readonly ProbeAnswer[]): Promise<readonly ProbeAnswer[]> {
    return this.#meshes && this.#models.length > 0 ? this.#meshes.probe(points, answers) : answers;
  }

  /** @param stats of all splats together */
  statsWith(stats: SceneStats): SceneStats {
    const { scene, element } = this.stage;
    const { state, error } = scene;
    const own: PartStats[] = state === 'empty' ? [] : [{ element, state, error, ...costOf(scene.scene) }];
    const parts = [...own, ...[...this.#parts].map((part) => part.stats)];
    const meshes = this.members.reduce((sum, { scene: { model } }) => sum + (model?.byteLength ?? 0), 0);
    const isPreview = stats.isPreview || [...this.#parts].some((part) => part.isPreview);
    return { ...stats, isPreview, bytes: { ...stats.bytes, scene: stats.bytes.scene + meshes }, scenes: parts };
  }

  /** Whether the page is to hear that a device was lost, or that all is back. */
  tellsContext(type: 'contextlost' | 'contextrestored', who: object = this.stage): boolean {
    const before = this.#lost.size;
    if (type === 'contextlost') this.#lost.add(who);
    else this.#lost.delete(who);
    return type === 'contextlost' ? before === 0 : before > 0 && this.#lost.size === 0;
  }

  /** Called after each update of the element, and when it comes into sight. */
  update(): void {
    this.#setDuration();
    for (const part of this.#parts) {
      part.request();
      part.autoplay();
    }
  }

  notePace(isWhole: boolean): void {
    for (const part of this.#parts) part.notePace(isWhole);
  }
}
