/** Effects of an element with cuts, a reveal effect or a shader. Loaded on demand. */
import { GaussianSplatError, linearDeterminant, multiply, type Matrix4 } from '@gaussian-splat/core';
import {
  directionIn,
  MAX_CUTS,
  SplatModifier,
  SplatProgram,
  type SplatChanges,
  type SplatCut,
  type SplatShader,
} from '@gaussian-splat/renderer/modifiers';
import { matrixOfFrame, transposed } from '../../viewer/camera/placing.js';
import type { Player } from '../../viewer/playback-controller.js';
import type { Viewer } from '../../viewer/viewer.js';
import { MAX_MOVER_STEP_MS, prefersReducedMotion } from '../../viewer/motion.js';
import type { Feature } from '../../viewer/features.js';
import type { LoadedGaussians } from '../../gpu/loaded-gaussians.js';
import type { SceneGroups } from '../../loading/protocol.js';
import { groupsNamed } from '../../shared/splat-groups.js';
import type { WorldEntry } from '../../viewer/world-entry.js';
import type { SourceEntry, SourceOwner } from '../../viewer/source-entry.js';
import { defineCuts } from './define.js';
import { NO_REVEAL, parseReveal, revealedBy, REVEAL_FORM, type RevealEffect } from './reveal.js';
import { SplatCutElement, showers, type PlacedCut } from './splat-cut.js';

/** A cut in world coordinates, with the names of its groups. */
interface NamedCut extends SplatCut {
  readonly names?: readonly string[] | undefined;
}

/** Applies the cuts of children, the reveal effect, and the page's shader to the splats of all scenes. */
export class Effects implements Feature {
  readonly #viewer: Viewer;
  /** Compiled program of the current shader by device. */
  #programs = new WeakMap<GPUDevice, SplatProgram>();
  readonly #compiling = new WeakMap<GPUDevice, Promise<void>>();
  readonly #modifiers = new Map<WorldEntry, SplatModifier>();
  #cuts: readonly SplatCutElement[] | undefined;
  #shader: SplatShader | null = null;
  #refused: SplatShader | null = null;
  #time = 0;
  #isPlaying = false;
  #last: number | undefined;
  #reveal: RevealEffect = NO_REVEAL;
  #revealText: string | null = null;
  /** URL of the scene that the reveal effect is for. */
  #url = '';
  #startedAt: number | undefined;
  #progress = 0;

  constructor(viewer: Viewer) {
    this.#viewer = viewer;
    showers.set(viewer.element, this);
    defineCuts();
    viewer.element.addController({ hostUpdated: () => this.#update() });
    // Without a scene no frame is drawn.
    viewer.element.addEventListener('emptied', () => this.#freeRemoved());
    this.#update();
    // Earlier frames were drawn without effects, because this code was not loaded.
    viewer.requestFrame();
  }

  cutsChanged(): void {
    this.#cuts = undefined;
    this.#viewer.requestFrame();
  }

  /**
   * Returns the interface with which the button for automatic motion plays and pauses `other` together with an animated
   * shader. Returns `other` itself if the shader is not animated.
   */
  playerWith(other: Player | undefined): Player | undefined {
    if (!this.#shader?.animated) return other;
    const players: Player[] = [this.#player, ...(other?.canPlay ? [other] : [])];
    return {
      canPlay: true,
      paused: players.every(({ paused }) => paused),
      play: () => players.forEach((each) => each.play()),
      pause: () => players.forEach((each) => each.pause()),
    };
  }

  get #player(): Player {
    const turn = (isPlaying: boolean): void => {
      this.#isPlaying = isPlaying;
      this.#viewer.requestFrame();
      this.#viewer.element.requestUpdate();
    };
    return { canPlay: true, paused: !this.#isPlaying, play: () => turn(true), pause: () => turn(false) };
  }

  advance(now: number): boolean {
    const step = Math.min(MAX_MOVER_STEP_MS, now - (this.#last ?? now));
    this.#last = now;
    const moves = Boolean(this.#shader?.animated && this.#isPlaying && this.#viewer.isOnShow);
    if (moves) this.#time += step / 1000;
    return this.#advanceReveal(now) || moves;
  }

  /** Compiles the pipelines that a scene needs for effects, before its first frame. Never rejects. */
  async prepareFor(scene: LoadedGaussians): Promise<void> {
    this.#restartReveal(this.#viewer.sources.ownEntry);
    if (this.#isWanted) await this.#compile(scene);
  }

  /** Writes the effects of all scenes to the world. Called before each frame. */
  prepareFrame(): void {
    const { entries, ownEntry: own } = this.#viewer.sources;
    this.#restartReveal(own);
    this.#freeRemoved();
    const shared = this.#sharedChanges;
    for (const { owner, member } of entries) if (member) this.#modify(member, owner, shared);
  }

  get #isRevealing(): boolean {
    return this.#reveal.kind !== 'none' && this.#revealed < 1 && !prefersReducedMotion();
  }

  /** Progress of the reveal effect, 0..1: that of the page, or else by time. */
  get #revealed(): number {
    return Math.min(1, Math.max(0, this.#givenProgress ?? this.#progress));
  }

  /** Progress that the page sets; undefined without one, and for NaN. */
  get #givenProgress(): number | undefined {
    const { revealProgress } = this.#viewer.element;
    return typeof revealProgress === 'number' && !Number.isNaN(revealProgress) ? revealProgress : undefined;
  }

  get #isWanted(): boolean {
    return this.#isRevealing || this.#shader !== null || this.#children.length > 0;
  }

  get #children(): readonly SplatCutElement[] {
    const found = this.#viewer.element.querySelectorAll(':scope > splat-cut, :scope > splat-scene > splat-cut');
    return (this.#cuts ??= [...found].filter((each) => each instanceof SplatCutElement));
  }

  /** Changes that apply to all scenes: the reveal effect, and cuts that are children of the element. */
  get #sharedChanges(): SplatChanges & { readonly cuts: readonly NamedCut[] } {
    const { frame, sources, element } = this.#viewer;
    const bounds = this.#isRevealing ? sources.bounds : null;
    const toWorld = transposed(matrixOfFrame(frame));
    const reveal = bounds
      ? revealedBy(this.#reveal, this.#revealed, bounds, directionIn(toWorld, this.#reveal.axis))
      : {};
    const cuts = [...this.#cutsOf(element, toWorld), ...(reveal.cuts ?? [])];
    const uniforms = element.splatShader?.uniforms;
    return { ...reveal, cuts, time: this.#time, uniforms, worldToViewer: matrixOfFrame(frame) };
  }

  /** Returns the cuts that are children of a parent, in world coordinates. */
  #cutsOf(parent: Element, toWorld: Matrix4): NamedCut[] {
    return this.#children
      .filter(({ parentElement }) => parentElement === parent)
      .flatMap(({ cut }) => (cut ? [inWorld(cut, toWorld)] : []));
  }

  #modify(member: WorldEntry, owner: SourceOwner, shared: SplatChanges & { readonly cuts: readonly NamedCut[] }): void {
    const { placement, scene } = member;
    const toWorld = owner.frameToWorld?.(member);
    const own = toWorld ? this.#cutsOf(owner.element, toWorld) : [];
    const cuts = [...own, ...shared.cuts].flatMap((each) => this.#withGroups(each, scene, owner.element));
    const changes = { ...shared, cuts };
    const { grown = 1, share = 1 } = changes;
    const isChanged = cuts.length > 0 || grown < 1 || share < 1 || this.#shader !== null;
    let modifier = this.#modifiers.get(member);
    if (cuts.length > MAX_CUTS) this.#viewer.warn(tooManyCuts(cuts.length));
    if (isChanged && !scene.can('modifiers')) return this.#viewer.warn(NO_WEBGL);
    if (!isChanged || scene.drawn.blocks.length === 0) {
      if (modifier) this.#forget(member, modifier);
      return;
    }
    const program = this.#programs.get(scene.place.device);
    if (!program) return void this.#compile(scene).then(() => this.#viewer.requestFrame());
    if (modifier?.program !== program) {
      modifier?.destroy();
      this.#modifiers.set(member, (modifier = new SplatModifier(scene.place.device, program, scene.groups)));
    }
    if (modifier.write(changes, placement) || placement.modifier !== modifier) placement.modifier = modifier;
  }

  /** Finds the groups that a cut names. Scenes without groups ignore such a cut. */
  #withGroups(named: NamedCut, { groups }: LoadedGaussians, owner: Element): SplatCut[] {
    const { names, ...cut } = named;
    if (!names) return [cut];
    const indices = groups && groupsNamed(groups, names, owner);
    // If there are several scenes, the others may have the groups.
    if (!indices?.length && this.#viewer.sources.members.length === 1) this.#viewer.warn(noGroup(names, groups));
    return indices ? [{ ...cut, groups: indices }] : [];
  }

  /** Frees the modifiers of scenes that are not shown any more. Their placements have left the world. */
  #freeRemoved(): void {
    const { entries } = this.#viewer.sources;
    for (const [member, modifier] of this.#modifiers) {
      if (entries.some((entry) => entry.member === member)) continue;
      this.#modifiers.delete(member);
      modifier.destroy();
    }
  }

  #forget(member: WorldEntry, modifier: SplatModifier): void {
    this.#modifiers.delete(member);
    if (member.placement.modifier === modifier) member.placement.modifier = undefined;
    modifier.destroy();
  }

  #compile(scene: LoadedGaussians): Promise<void> {
    if (!scene.can('modifiers')) return Promise.resolve();
    const { device } = scene.place;
    const before = this.#compiling.get(device) ?? Promise.resolve();
    const compiling = before.then(() => this.#compileNow(device, scene));
    this.#compiling.set(device, compiling);
    return compiling;
  }

  async #compileNow(device: GPUDevice, scene: LoadedGaussians): Promise<void> {
    const shader = this.#shader;
    const scenes = [scene.drawn];
    let program: SplatProgram | undefined;
    try {
      program = await SplatProgram.compile(device, scenes, shader ?? undefined);
    } catch (error) {
      if (shader === this.#shader) this.#refuse(shader, error as Error);
      program = await SplatProgram.compile(device, scenes).catch(() => undefined);
    }
    if (program) this.#programs.set(device, program);
  }

  /** Discards a shader that does not compile: reports it, and draws the scenes without it. */
  #refuse(shader: SplatShader | null, error: Error): void {
    if (shader === null) return;
    this.#shader = null;
    this.#refused = shader;
    this.#viewer.warn(error.message);
    this.#viewer.element.dispatchEvent(new CustomEvent('shader-error', { detail: error }));
    this.#viewer.requestFrame();
  }

  /** Reads the attribute and the property that select effects, after an update of the element. */
  #update(): void {
    const { element, attributes } = this.#viewer;
    this.#readReveal(attributes.revealEffect);
    const shader = element.splatShader ?? null;
    if (shader !== null && shader === this.#refused) return;
    if (shader !== this.#shader) this.#useShader(shader);
  }

  #useShader(shader: SplatShader | null): void {
    const before = this.#shader;
    this.#refused = null;
    this.#shader = shader;
    if (shader?.animated && !before?.animated) this.#isPlaying = !prefersReducedMotion();
    // The button for automatic motion was rendered earlier in this update, so it needs another one.
    if (shader?.animated !== before?.animated) this.#viewer.element.requestUpdate();
    this.#viewer.requestFrame();
    // If only values have changed, the program stays the same.
    if (shader && before && isSameCode(shader, before)) return;
    const scenes = this.#viewer.sources.entries.flatMap(({ member }) => member?.scene ?? []);
    // The current program is used until the next one is compiled.
    if (scenes.length === 0) this.#programs = new WeakMap();
    for (const scene of scenes) void this.#compile(scene).then(() => this.#viewer.requestFrame());
  }

  #readReveal(text: string | null): void {
    if (text === this.#revealText) return;
    this.#revealText = text;
    const effect = parseReveal(text);
    if (effect === null) this.#viewer.warn(`<gaussian-splat> reveal-effect: expected ${REVEAL_FORM}, found "${text}".`);
    this.#reveal = effect ?? NO_REVEAL;
  }

  /**
   * Restarts the reveal effect if the element's scene has another URL. A scene that is about to be replaced is shown
   * already, so the effect waits for the next one.
   */
  #restartReveal(own: SourceEntry): void {
    const { url, isOutgoing } = own.scene;
    if (url === this.#url || isOutgoing) return;
    this.#url = url;
    this.#startedAt = undefined;
    this.#progress = 0;
  }

  #advanceReveal(now: number): boolean {
    if (!this.#isRevealing || !this.#viewer.isOnShow || this.#givenProgress !== undefined) return false;
    this.#startedAt ??= now;
    const { isPreview, progress } = this.#viewer.sources;
    const byTime = (now - this.#startedAt) / Math.max(1, this.#reveal.milliseconds);
    // The effect `detail` does not exceed the fraction of data that has arrived.
    this.#progress = this.#reveal.kind === 'detail' && isPreview ? Math.min(byTime, progress ?? 0, 0.95) : byTime;
    return this.#progress < 1;
  }
}

/** Message for too many cuts. Cuts of the scene take precedence, then those of the element, then the reveal effect. */
const tooManyCuts = (found: number): string =>
  new GaussianSplatError('argument/splat-cut', {
    where: '<splat-cut>',
    expected: `at most ${MAX_CUTS} cuts of one scene, a reveal by sweep included`,
    found: `${found}; the last are left out`,
    remedy: 'put cuts of one scene into its <splat-scene>, and hide those that are not needed',
  }).message;

/** Message for a cut whose groups the scene lacks. */
const noGroup = (names: readonly string[], groups: SceneGroups | undefined): string =>
  new GaussianSplatError('argument/splat-cut', {
    where: '<splat-cut group>',
    expected: groups
      ? `groups with names or the numbers ${groups.ids.join(', ').slice(0, 200)}`
      : 'a scene with groups',
    found: names.join(', '),
    remedy: 'set the attributes groups and group-names of the element with the scene',
  }).message;

const NO_WEBGL =
  '<gaussian-splat>: WebGL 2 draws the scene without <splat-cut>, reveal-effect and splatShader, which need WebGPU.';

/** Whether two shaders compile to the same program. */
const isSameCode = (a: SplatShader, b: SplatShader): boolean => {
  const of = ({ code, moves, uniforms = {} }: SplatShader): string =>
    JSON.stringify([code, moves, Object.entries(uniforms).map(([name, value]) => [name, Object(value).length])]);
  return of(a) === of(b);
};

/** Converts a cut from the coordinates of its parent to the world. */
function inWorld({ placed, offset, edge, ...cut }: PlacedCut, toWorld: Matrix4): NamedCut {
  const size = Math.cbrt(Math.abs(linearDeterminant(toWorld)));
  return {
    ...cut,
    edge: typeof edge === 'number' ? edge * size : edge,
    offset: offset && directionIn(toWorld, offset),
    shapeToWorld: multiply(toWorld, placed),
  };
}
