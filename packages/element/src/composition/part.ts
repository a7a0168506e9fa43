import type { Camera, Matrix4 } from '@gaussian-splat/core';
import type { FrameTarget, ProbeAnswer, ProbePoint } from '@gaussian-splat/renderer';
import type { ViewerFrame } from '../camera/orbit.js';
import type { SceneState } from '../controllers/scene-controller.js';
import type { PlaybackController } from '../controllers/playback-controller.js';
import type { ElementError } from '../errors.js';
import type { LoadedGaussians, MeshModel } from '../gpu/loaded-gaussians.js';
import type { Frame } from '../live/frame-filter.js';
import type { PartStats } from '../stats.js';
import type { Member } from '../member.js';
import type { Composition } from './composition.js';

/** A mesh where it is drawn. */
export interface PlacedModel {
  readonly model: MeshModel;
  readonly toWorld: Matrix4;
}

/** What draws the meshes of an element, on one device. */
export interface MeshDrawing {
  readonly device: GPUDevice;
  /** Draws them into a frame. @returns where splats are drawn over them */
  draw(frame: Frame, models: readonly PlacedModel[], world: ViewerFrame): Partial<FrameTarget>;
  /** Puts depths of meshes into what was found of splats. */
  probe(points: readonly ProbePoint[], answers: readonly ProbeAnswer[]): Promise<readonly ProbeAnswer[]>;
  destroy(): void;
}

/** What a scene takes. */
export const costOf = (
  scene: LoadedGaussians | null,
): Pick<PartStats, 'splats' | 'triangles' | 'dropped' | 'bytes'> => ({
  splats: scene ? (scene.gaussians.frameCount ?? scene.gaussians.count) : 0,
  triangles: scene?.model?.triangles ?? 0,
  dropped: scene?.gaussians.droppedCount ?? 0,
  bytes: scene ? scene.gaussians.byteLength + (scene.levels?.byteLength ?? 0) + (scene.model?.byteLength ?? 0) : 0,
});

/** One of the things that an element shows besides its own scene, in the hands of {@link Composition}. */
export interface Part {
  readonly state: SceneState;
  readonly error: ElementError | null;
  readonly settled: Promise<void>;
  readonly progress: number | null;
  /** What it has on the GPU. */
  readonly source: LoadedGaussians | null;
  /** Its splats in the world; undefined for none. */
  readonly member: Member | undefined;
  /** Something of it is drawn, or about to be. */
  readonly isEntered: boolean;
  /** There is something of it to see. */
  readonly isShown: boolean;
  /** What is shown is a part of what is still loading. */
  readonly isPreview: boolean;
  /** It has played or was told not to: it begins by itself no more. */
  hasBegun: boolean;
  /** Plays by itself, on its own clock. */
  readonly autoplays: boolean;
  /** The clock that it follows. */
  readonly playback: PlaybackController;
  /** Its own, which it may not follow. */
  readonly ownClock: PlaybackController;
  /** Seconds that it moves for; NaN for what does not. */
  readonly duration: number;
  readonly hasOwnClock: boolean;
  /** Absolute address of what was asked for last. */
  readonly url: string;
  readonly stats: PartStats;
  /** The element that it belongs to; null for none. */
  readonly owner: Element | null;
  /** It belongs to this element from now on, or to none. */
  attach(composition: Composition | null): void;
  /** Its attributes, or those of the element, may ask for something else, or it may be loaded now. */
  request(): void;
  /** The same, after its own attributes have changed. */
  update(): void;
  reload(): void;
  /** Begins to play, if it plays by itself and may. */
  autoplay(): void;
  /** Puts it where its attributes say, before a frame. */
  place(): void;
  /** What moves goes on to the moment of a frame. */
  advance(camera: Camera, now: number): void;
  /** It is drawn no more: its memory is about to go, or to be another element's. */
  leave(): void;
  /** A frame could not be drawn with it. */
  fail(error: unknown): void;
  notePace(isWhole: boolean): void;
}
