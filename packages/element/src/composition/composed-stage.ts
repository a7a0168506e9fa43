import type { Camera } from '@gaussian-splat/core';
import type { FrameTarget, ProbeAnswer, ProbePoint } from '@gaussian-splat/renderer';
import type { SceneBounds } from '../camera/settings.js';
import type { Entrance, SceneState } from '../controllers/scene-controller.js';
import type { ElementError } from '../errors.js';
import type { DetailLevers, LoadedGaussians } from '../gpu/loaded-gaussians.js';
import type { Frame } from '../live/frame-filter.js';
import { Stage } from '../stage.js';
import type { SceneStats } from '../stats.js';
import { compositions } from './child.js';
import type { Composition } from './composition.js';

/** No field of its own: the stage is there before it becomes one. */
const allOf = ({ element }: Stage): Composition => compositions.get(element)!;

/**
 * The stage of an element that has children. A stage becomes one when its first child comes, as an element becomes a custom one when its definition does: so that pages without
 * children carry nothing of this.
 */
export class ComposedStage extends Stage {
  override get state(): SceneState {
    return allOf(this).state;
  }

  override get error(): ElementError | null {
    return allOf(this).error;
  }

  override get settled(): Promise<void> {
    return Promise.all([super.settled, allOf(this).settled]).then(() => undefined);
  }

  override get progress(): number | null {
    return allOf(this).progressWith(super.progress);
  }

  override get hasPicture(): boolean {
    return super.hasPicture || allOf(this).hasPicture;
  }

  override get shown(): readonly LoadedGaussians[] {
    return allOf(this).members.map(({ scene }) => scene);
  }

  override get levels(): DetailLevers {
    return allOf(this).levels;
  }

  override get bounds(): SceneBounds | null {
    return allOf(this).bounds;
  }

  override readBounds(): Promise<SceneBounds | null> {
    return allOf(this).readBounds();
  }

  override get player(): Stage['player'] {
    return allOf(this).playerWith(this.autoplays ? this.playback : undefined);
  }

  override get stats(): SceneStats | null {
    const stats = super.stats;
    return stats && allOf(this).statsWith(stats);
  }

  override prepareFrame(): string {
    return `${allOf(this).prepareFrame()} ${super.prepareFrame()}`;
  }

  drawBeneath(frame: Frame): Partial<FrameTarget> {
    return allOf(this).drawBeneath(frame);
  }

  override async probe(points: readonly ProbePoint[]): Promise<readonly ProbeAnswer[]> {
    return allOf(this).probe(points, await super.probe(points));
  }

  override advanceScene(camera: Camera, now: number): void {
    super.advanceScene(camera, now);
    allOf(this).advance(camera, now);
  }

  override show(scene: LoadedGaussians, entrance: Entrance): Promise<void> {
    return allOf(this).show(scene, entrance);
  }

  override hide(clear: boolean): void {
    allOf(this).hide(clear);
  }

  override suspend(): void {
    super.suspend();
    allOf(this).suspend();
  }

  override autoplay(): void {
    super.autoplay();
    allOf(this).autoplay();
  }

  override notePace(isWhole: boolean): void {
    super.notePace(isWhole);
    allOf(this).notePace(isWhole);
  }

  override drawingFailed(error: unknown): void {
    allOf(this).fail(error);
  }

  override contextChanged(type: 'contextlost' | 'contextrestored'): void {
    if (allOf(this).tellsContext(type)) super.contextChanged(type);
  }

  override updated(): void {
    super.updated();
    allOf(this).update();
  }
}
