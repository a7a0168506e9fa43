import type { Camera } from '@gaussian-splat/core';
import { World, type Placed, type Placement, type ProbeAnswer, type ProbePoint } from '@gaussian-splat/renderer';
import type { SceneBounds } from './camera/settings.js';
import type { MotionHost } from './controllers/motion-controller.js';
import { prefersReducedMotion } from './controllers/mover.js';
import type { Entrance, SceneState } from './controllers/scene-controller.js';
import type { ElementError } from './errors.js';
import type { DetailLevers, LoadedGaussians } from './gpu/loaded-gaussians.js';
import type { Contents } from './gpu/viewport.js';
import type { Stage } from './stage.js';
import { statsOf, type SceneStats, type StatsContext } from './stats.js';

/** A loaded source in the world. */
export class Member {
  readonly scene: LoadedGaussians;
  readonly #world: World;
  #placement: Placement;

  constructor(world: World, scene: LoadedGaussians, placed: Omit<Placed, 'scene'> = {}) {
    this.#world = world;
    this.scene = scene;
    this.#placement = world.add({ ...placed, bounds: scene.bounds, scene: scene.drawn });
  }

  /** How it stands in the world. Other splats of the source may be drawn now than in the last frame: levels of detail, or a sequence's next buffers. */
  get placement(): Placement {
    const { drawn } = this.scene;
    const before = this.#placement;
    if (before.scene !== drawn) {
      this.remove();
      const { sceneToWorld, opacity, crop, visible, bounds } = before;
      this.#placement = this.#world.add({ scene: drawn, sceneToWorld, opacity, crop, visible, bounds });
    }
    return this.#placement;
  }

  remove(): void {
    this.#world.remove(this.#placement);
  }
}

/** All that an element shows: here the scene of its own `src`. `Composition`, loaded where there are children, shows theirs besides. */
export class Whole implements Contents {
  readonly stage: Stage;
  readonly world: World;
  /** The element's own scene. */
  own: Member | undefined;

  constructor(stage: Stage, world = new World()) {
    this.stage = stage;
    this.world = world;
  }

  get state(): SceneState {
    return this.stage.scene.state;
  }

  /** Why nothing is shown. */
  get error(): ElementError | null {
    return this.stage.scene.error;
  }

  /** Fulfils, and never rejects, once nothing is left to wait for. */
  get settled(): Promise<void> {
    return this.stage.scene.settled;
  }

  /** Share of the loading that is done, 0..1; null while it is not known. */
  get progress(): number | null {
    return this.stage.ownProgress;
  }

  /** There is something to see. */
  get hasPicture(): boolean {
    return this.stage.scene.state === 'ready' || this.stage.scene.isPreview;
  }

  /** What is shown is a part of scenes that are still loading. */
  get isPreview(): boolean {
    return this.stage.scene.isPreview;
  }

  /** The sources that are shown. */
  get shown(): readonly LoadedGaussians[] {
    return this.own ? [this.own.scene] : [];
  }

  get detail(): DetailLevers {
    return this.own?.scene.detail ?? {};
  }

  prepare(): string {
    void this.own?.placement;
    const { layout, changes, placements } = this.world;
    return `${layout} ${changes} ${placements.map(({ scene }) => scene.version).join()}`;
  }

  /** Where it is, in the frame of the element's own scene; null while nothing is shown. */
  get bounds(): SceneBounds | null {
    return this.stage.scene.scene?.bounds ?? null;
  }

  /** The same, measured anew where a generator may have moved it. */
  async readBounds(): Promise<SceneBounds | null> {
    const { scene } = this.stage.scene;
    return (await scene?.live?.readBounds?.()) ?? this.bounds;
  }

  /** What the visitor's switch for motion stops and starts. */
  get player(): MotionHost['player'] {
    return this.stage.playback;
  }

  /** The page asks something that moves to play by itself. */
  get autoplays(): boolean {
    return this.stage.autoplaysOwn;
  }

  /** Starts what plays by itself, where it may. */
  autoplay(): void {
    const { playback, autoplaysOwn, behaviours } = this.stage;
    const mayPlay = playback.canPlay && playback.paused && !prefersReducedMotion();
    if (autoplaysOwn && mayPlay && !behaviours.motion.isHeld) playback.play();
  }

  /** Takes over the element's own scene; fulfils once its first frame is drawn. */
  show(scene: LoadedGaussians, entrance: Entrance): Promise<void> {
    const { camera, playback, view, live } = this.stage;
    if (entrance === 'new') camera.frame(scene.bounds);
    if (entrance === 'whole') camera.refine(scene.bounds);
    playback.setDuration(scene.live?.duration ?? NaN);
    scene.onChange = () => view.requestFrame();
    this.own = new Member(this.world, scene);
    if (scene.hasMeshes) this.stage.childrenChanged(true);
    const drawn = view.show(scene);
    live.post.attach(view.viewport, () => scene.live?.settable ?? []);
    return drawn;
  }

  /** The element's own scene is about to go, with (`clear`) or without its picture. */
  hide(clear: boolean): void {
    this.own?.remove();
    this.own = undefined;
    this.stage.stopDrawing(clear);
  }

  /** Before a frame: what moves goes on. */
  advance(camera: Camera, now: number): void {
    const { scene, live } = this.stage;
    // The last picture of a scene whose place another will take stays as it is.
    if (scene.scene && !scene.isOutgoing) live.advance(scene.scene, camera, now);
  }

  /** A frame could not be drawn, and none will be. */
  fail(error: unknown): void {
    this.stage.scene.fail(error);
  }

  /** Looks into the last frame. */
  async probe(points: readonly ProbePoint[]): Promise<readonly ProbeAnswer[]> {
    return (await this.stage.view.viewport?.viewpoint.probe(points)) ?? [];
  }

  stats(context: StatsContext): SceneStats | null {
    return this.own ? statsOf(this.shown, context) : null;
  }

  /** The device was lost, or all of it is back: whether the page is to hear of it. */
  tellsContext(_type: 'contextlost' | 'contextrestored'): boolean {
    return true;
  }

  /** What is asked for may be another thing now, or may be loaded now. */
  request(): void {}

  /** A pause of the picture is not time that passes. */
  suspend(): void {
    this.stage.playback.suspend();
  }

  /** Called after each update of the element. */
  update(): void {
    const { scene, detail } = this.stage;
    detail.update(scene.state === 'ready' ? scene.scene : null);
  }

  /** Tells of each picture in motion whether it was drawn whole. */
  notePace(isWhole: boolean): void {
    this.stage.detail.notePace(isWhole);
  }
}
