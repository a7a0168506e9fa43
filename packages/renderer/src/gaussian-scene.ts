import type { Camera, FilterRule, ShDegree, Vector3 } from '@gaussian-splat/core';
import type { GeometryReading } from './geometry-reading.js';
import type { Resource } from './gpu/kernel.js';
import type { RenderSettings } from './render-settings.js';
import type { DetailBudget } from './stages/detail-budget.js';
import type { ShPrecision } from './pack/words.js';

/** A block of Gaussians: a scene has as many as its size and the binding limits of the device require. */
export interface GaussianBlock {
  readonly count: number;
  /** array<PackedGaussian>, or the layout that {@link reading} reads */
  readonly geometry: GPUBuffer;
  /** Shaders that read another layout of geometry; undefined for PackedGaussian. */
  readonly reading?: GeometryReading;
  /** array<vec2u>: spherical harmonics, see pack/sh.ts */
  readonly sh: GPUBuffer;
  /** array<Chunk>: bounds of each 256 splats */
  readonly chunks: GPUBuffer;
  /** array<ChunkDetail>; undefined without levels of detail. */
  readonly details?: GPUBuffer;
}

/** Inputs of {@link PageRequests}: a view, and the content of a page in the pool. */
export type FeedbackInputs = Readonly<Record<'view' | 'chunks' | 'details', Resource>> & {
  readonly chunk_shares: GPUBuffer;
};

/** Settings that influence which pages a view requests. */
export type FeedbackSettings = Pick<RenderSettings, 'detail' | 'detailFade' | 'splatBudget'>;

/**
 * Transfers the requests of a view for pages from the GPU to the streaming code. Streamed scenes provide it, so that
 * other pages do not load its code.
 */
export interface PageRequests {
  /** Returns the bind group of a page in the pool, for {@link PageRequests.note}. */
  bind(page: FeedbackInputs): GPUBindGroup;
  /**
   * Call this with the camera, the settings and `World.changes` of each frame. Returns whether this frame should record
   * requests. If so, call `begin`, `note` for each page of the pool, `copy`, and after the submit `read`.
   */
  isDue(camera: Camera, settings: FeedbackSettings, changes: number): boolean;
  begin(encoder: GPUCommandEncoder): void;
  note(pass: GPUComputePassEncoder, bindings: GPUBindGroup, splatCount: number): void;
  copy(encoder: GPUCommandEncoder): void;
  read(): void;
}

/**
 * Gaussians on the GPU for a {@link Viewpoint}. `GaussianBuffers` contains those of a file, `DynamicGaussians` those of
 * a generator. Only the content of the buffers changes during the lifetime of a scene.
 */
export interface GaussianScene extends FilterRule {
  /** Capacity in splats. All of them are processed, but transparent ones are not drawn. */
  readonly count: number;
  readonly shDegree: ShDegree;
  readonly shPrecision: ShPrecision;
  /** World position, in float64, of the origin of the positions on the GPU. */
  readonly origin: Vector3;
  readonly blocks: readonly GaussianBlock[];
  /**
   * Stages that keep frames within `RenderSettings.splatBudget`. Only scenes with levels of detail provide them, so
   * that other pages do not load their code.
   */
  readonly detailBudget?: DetailBudget | undefined;
  /** Requests for the pages that views need; only for a streamed scene. */
  readonly pageRequests?: PageRequests;
  /** Called before each frame: a streamed scene uploads the received pages. */
  update?(): void;
  /** Incremented whenever the content of the buffers changes; 0 for a scene that never changes. */
  readonly version: number;
}
