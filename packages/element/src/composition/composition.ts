import { loadModule, multiply, type Camera, type Matrix4 } from '@gaussian-splat/core';
import { type Picture, type ProbeAnswer, type ProbePoint } from '@gaussian-splat/renderer';
import type { ViewerFrame } from '../camera/orbit.js';
import { frameOf, type SceneBounds } from '../camera/settings.js';
import type { MotionHost } from '../controllers/motion-controller.js';
import { prefersReducedMotion } from '../controllers/mover.js';
import type { PlaybackController } from '../controllers/playback-controller.js';
import type { Entrance, SceneState } from '../controllers/scene-controller.js';
import type { ElementError } from '../errors.js';
import type { DetailLevers, LoadedGaussians } from '../gpu/loaded-gaussians.js';
import type { Place } from '../gpu/viewport.js';
import type * as meshes from './meshes/open-mesh.js';
import type { Frame } from '../live/frame-filter.js';
import type { Stage } from '../stage.js';
import { statsOf, type PartStats, type SceneStats, type StatsContext } from '../stats.js';
import { Member, Whole } from '../whole.js';
import { credentialsOf } from '../attributes.js';
import type { SceneSlot } from './scene-slot.js';
import { costOf, type MeshDrawing, type Part, type PlacedModel } from './part.js';

/** From a glTF's axes, y up, to those of the cloud that its splats are read as. */
const GLTF_TO_CLOUD: Matrix4 = [-1, 0, 0, 0, 0, -1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1];
const IDENTITY: Matrix4 = [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1];

const loadMeshes = (): Promise<typeof meshes> =>
  loadModule('the code that shows meshes', () => import('./meshes/open-mesh.js'));

/** States from the one that says most of several parts on. */
const STATES: readonly SceneState[] = ['ready', 'loading', 'waiting', 'failed'];

/** Shows the scenes and meshes of an element's children beside its own scene. */
export class Composition extends Whole {
  /** What draws meshes, where there are some. */
  #meshes: MeshDrawing | undefined;
  readonly #parts = new Set<Part>();
  /** Parts come one after the other, so that one that fails is known. */
  #arrivals: Promise<void> | undefined;
  #latest: Part | Stage | undefined;
  #isFramed = false;
  #isToldLoaded = false;
  readonly #lost = new Set<object>();

  /** Takes over from what has shown the element's own scene alone. */
  constructor(stage: Stage, before: Whole) {
    super(stage, before.world);
    this.own = before.own;
    this.#isFramed = before.own !== undefined;
    if (before.own?.scene.hasMeshes) void this.#addMeshes(stage, before.own.scene);
  }

  // The parts.

  add(part: Part): void {
    this.#parts.add(part);
    this.#changed();
  }

  remove(part: Part): void {
    this.#parts.delete(part);
    part.leave();
    this.tellsContext('contextrestored', part);
    this.left(false);
    this.#changed();
  }

  /**
   * Shows what a part has loaded, once those before it are drawn. Fulfils when it is, or need not be any more; rejects with GaussianSplatError `out-of-memory/*`.
   * @param enter puts it into the world, or whatever draws it
   */
  #arrive(part: Part | Stage, scene: LoadedGaussians, entrance: Entrance, enter: () => void): Promise<void> {
    const show = async (): Promise<void> => {
      if (scene.model) await this.#prepareMeshes(scene);
      if (scene.isDestroyed || scene.isLost) return;
      enter();
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
      enter(this.#memberOf(scene));
    });
  }

  #memberOf(scene: LoadedGaussians): Member {
    scene.onChange = () => this.stage.requestFrame();
    return new Member(this.world, scene);
  }

  /** Something is shown no more: draws what is left, or nothing. */
  left(clear: boolean): void {
    this.stage.splatsChanged();
    if (this.#isEmpty) {
      this.#isToldLoaded = false;
      this.#isFramed = false;
      this.stage.stopDrawing(clear);
    }
    if (this.shown.some(({ model }) => model)) return;
    this.#meshes?.destroy();
    this.#meshes = undefined;
  }

  /** Meshes that are drawn, and where. */
  get #models(): readonly PlacedModel[] {
    return [...(this.own ? [this.own] : []), ...this.#members].flatMap(({ scene, placement }) => {
      const { model, hasMeshes } = scene;
      if (!model || !placement.visible) return [];
      const { sceneToWorld = IDENTITY } = placement;
      return [{ model, toWorld: hasMeshes ? multiply(sceneToWorld, GLTF_TO_CLOUD) : sceneToWorld }];
    });
  }

  /** Makes what draws meshes on a device. */
  async #prepareMeshes({ device }: LoadedGaussians): Promise<void> {
    const { MeshLayer } = await loadMeshes();
    if (this.#meshes?.device === device) return;
    this.#meshes?.destroy();
    this.#meshes = undefined;
    this.#meshes = await MeshLayer.create(device);
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
    const before = view.viewport;
    const drawn = view.show(place);
    if (view.viewport !== before)
      live.post.attach(view.viewport, () => this.shown.flatMap((scene) => scene.live?.settable ?? []));
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

  get #members(): readonly Member[] {
    return [...this.#parts].flatMap(({ member }) => member ?? []);
  }

  get #isEmpty(): boolean {
    return this.own === undefined && ![...this.#parts].some(({ isEntered }) => isEntered);
  }

  #changed(): void {
    this.#setDuration();
    this.stage.splatsChanged();
  }

  /** The element's clock goes as far as its own scene, or else as what follows it. */
  #setDuration(): void {
    const { scene, playback } = this.stage;
    if (scene.state === 'waiting' || scene.state === 'loading') return;
    const own = this.own?.scene.live?.duration ?? NaN;
    const followed = [...this.#parts].flatMap(({ hasOwnClock, duration }) => (hasOwnClock ? [] : [duration]));
    const durations = [own, ...followed].filter((seconds) => !Number.isNaN(seconds));
    playback.setDuration(Number.isNaN(own) && durations.length > 0 ? Math.max(...durations) : own);
  }

  /** What plays by itself may begin. */
  get mayAutoplay(): boolean {
    return this.stage.isOnShow && !prefersReducedMotion() && !this.stage.behaviours.motion.isHeld;
  }

  /** Rotation from the world, the frame of the element's own scene, to viewer space. */
  get frame(): ViewerFrame {
    return frameOf(this.stage.attributes, { up: this.own?.scene.bounds.up });
  }

  // What the stage asks.

  override get state(): SceneState {
    const own = super.state;
    if (own !== 'empty' && own !== 'failed') return own;
    const states = [...this.#parts].map(({ state }) => state);
    return STATES.find((state) => states.includes(state)) ?? own;
  }

  override get error(): ElementError | null {
    const own = super.error;
    if (own || super.state !== 'empty' || this.state !== 'failed') return own;
    return [...this.#parts].find(({ error }) => error)?.error ?? null;
  }

  override get settled(): Promise<void> {
    return Promise.all([super.settled, ...[...this.#parts].map((part) => part.settled)]).then(() => undefined);
  }

  override get progress(): number | null {
    const all = [...this.#parts].filter(({ state }) => state !== 'empty' && state !== 'failed');
    const shares = all.map((part) => (part.state === 'ready' ? 1 : part.progress));
    const own = super.state === 'ready' ? 1 : super.progress;
    if (super.state !== 'empty' && super.state !== 'failed') shares.push(own);
    const known = shares.filter((share) => share !== null);
    return known.length > 0 ? known.reduce((sum, share) => sum + share, 0) / shares.length : null;
  }

  override get hasPicture(): boolean {
    return super.hasPicture || [...this.#parts].some(({ isShown }) => isShown);
  }

  override get isPreview(): boolean {
    return super.isPreview || [...this.#parts].some(({ isPreview }) => isPreview);
  }

  override get shown(): readonly LoadedGaussians[] {
    return [...super.shown, ...this.#members.map(({ scene }) => scene)];
  }

  override get detail(): DetailLevers {
    const all = this.shown.map(({ detail }) => detail);
    const most = (of: (levers: DetailLevers) => number | undefined): number => Math.max(0, ...all.map((each) => of(each) ?? 0));
    return { detail: most(({ detail }) => detail), splatBudget: most(({ splatBudget }) => splatBudget) };
  }

  override prepare(): string {
    for (const part of this.#parts) part.place();
    return `${super.prepare()} ${this.#models.map(({ model }) => model.version).join()}`;
  }

  drawBeneath(frame: Frame): Partial<Picture> {
    const models = this.#models;
    return this.#meshes && models.length > 0 ? this.#meshes.draw(frame, models, this.frame) : {};
  }

  override get bounds(): SceneBounds | null {
    for (const part of this.#parts) part.place();
    const bounds = this.world.bounds();
    return bounds ? { ...bounds, up: this.own?.scene.bounds.up } : null;
  }

  override async readBounds(): Promise<SceneBounds | null> {
    await Promise.all(
      [...(this.own ? [this.own] : []), ...this.#members].map(async (member) => {
        const bounds = await member.scene.live?.readBounds?.();
        if (bounds) member.placement.bounds = bounds;
      }),
    );
    return this.bounds;
  }

  override get autoplays(): boolean {
    return super.autoplays || [...this.#parts].some(({ autoplays }) => autoplays);
  }

  override get player(): MotionHost['player'] {
    const clocks: PlaybackController[] = [...this.#parts].flatMap(({ autoplays, ownClock }) => (autoplays ? [ownClock] : []));
    if (super.autoplays) clocks.push(this.stage.playback);
    const playable = clocks.filter(({ canPlay }) => canPlay);
    return {
      canPlay: playable.length > 0,
      paused: playable.every(({ paused }) => paused),
      play: () => playable.forEach((clock) => clock.play()),
      pause: () => playable.forEach((clock) => clock.pause()),
    };
  }

  override autoplay(): void {
    super.autoplay();
    for (const part of this.#parts) part.autoplay();
  }

  override show(scene: LoadedGaussians, entrance: Entrance): Promise<void> {
    return this.#arrive(this.stage, scene, entrance, () => {
      this.own?.remove();
      this.own = this.#memberOf(scene);
      this.#changed();
    });
  }

  override hide(clear: boolean): void {
    this.own?.remove();
    this.own = undefined;
    this.left(clear);
  }

  override advance(camera: Camera, now: number): void {
    const { playback } = this.stage;
    super.advance(camera, now);
    // Its own scene may stand still while others follow its clock.
    playback.tick(now);
    for (const part of this.#parts) part.advance(camera, now);
  }

  override suspend(): void {
    super.suspend();
    for (const { ownClock } of this.#parts) ownClock.suspend();
  }

  /** What came last was too much; whatever else it was, what is left is tried again. */
  override fail(error: unknown): void {
    const last = [...this.#parts].filter((part) => part.isEntered).pop();
    const latest = this.#latest === this.stage ? undefined : (this.#latest as Part | undefined);
    const blamed = latest?.isEntered ? latest : this.own ? undefined : last;
    this.#latest = undefined;
    if (blamed) blamed.fail(error);
    else if (this.own) super.fail(error);
  }

  override async probe(points: readonly ProbePoint[]): Promise<readonly ProbeAnswer[]> {
    const answers = await super.probe(points);
    return this.#meshes && this.#models.length > 0 ? this.#meshes.probe(points, answers) : answers;
  }

  override stats(context: StatsContext): SceneStats | null {
    if (!this.hasPicture) return null;
    const { scene, element } = this.stage;
    const { state, error } = scene;
    const own: PartStats[] = state === 'empty' ? [] : [{ element, state, error, ...costOf(scene.scene) }];
    const parts = [...this.#parts].map(({ stats }) => stats);
    const stats = statsOf(this.shown, context);
    const meshes = parts.reduce((sum, { triangles, bytes }) => sum + (triangles > 0 ? bytes : 0), 0);
    return { ...stats, bytes: { ...stats.bytes, scene: stats.bytes.scene + meshes }, scenes: [...own, ...parts] };
  }

  override tellsContext(type: 'contextlost' | 'contextrestored', who: object = this.stage): boolean {
    const before = this.#lost.size;
    if (type === 'contextlost') this.#lost.add(who);
    else this.#lost.delete(who);
    return type === 'contextlost' ? before === 0 : before > 0 && this.#lost.size === 0;
  }

  override request(): void {
    for (const part of this.#parts) part.request();
  }

  override update(): void {
    super.update();
    this.#setDuration();
    this.request();
    for (const part of this.#parts) part.autoplay();
  }

  override notePace(isWhole: boolean): void {
    super.notePace(isWhole);
    for (const part of this.#parts) part.notePace(isWhole);
  }
}
