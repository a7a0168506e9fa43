import { validateCloud, type GaussianCloud, type ShDegree } from '@gaussian-splat/core';
import type { GaussianBlock } from '@gaussian-splat/renderer/tools';
import {
  BUFFER_USAGE,
  constants,
  cullGroups,
  GpuMemory,
  ingestStage,
  Ingest,
  layouts,
  pageCapacity,
  recentered,
  SceneBuffers,
  shWords,
  withMemoryCheck,
  submitPass,
  uniformWith,
} from '@gaussian-splat/renderer/stages';
import { widthsOf } from '../parts/cloud-memory.js';

const { CULL_GROUP, SHAPE_SCALE, COLOR_COEFFICIENT_MAJOR } = constants;

/**
 * A cloud on the GPU. The stage for generator outputs packs it, in a tenth of the CPU time of other scenes. Splats keep
 * the order of the cloud, so that a slot is the index of a splat. Harmonics are float16. Unusable splats are not drawn.
 */
export class CloudBuffers extends SceneBuffers {
  readonly version = 0;
  readonly blocks: readonly GaussianBlock[];

  private constructor(device: GPUDevice, memory: GpuMemory, cloud: GaussianCloud, pageSplats: number) {
    super(memory, cloud, cloud.count);
    const max = pageCapacity(device, 4 * Math.max(...Object.values(widthsOf(cloud.shDegree))));
    const capacity = Math.min(max, CULL_GROUP * Math.max(1, Math.floor(pageSplats / CULL_GROUP)));
    const pages: GaussianBlock[] = [];
    for (let first = 0; first < cloud.count; first += capacity) {
      const page = pageOf(memory, cloud.shDegree, Math.min(capacity, cloud.count - first));
      pack(device, cloud, first, page);
      pages.push(page);
    }
    this.blocks = pages;
  }

  /**
   * Uploads and packs a cloud.
   * @param pageSplats Maximum number of splats in a block. By default, only the limits of the device apply.
   * @throws GaussianSplatError `argument/cloud` if the arrays do not match `count` and `shDegree`; `out-of-memory/*`
   */
  static async upload(device: GPUDevice, cloud: GaussianCloud, pageSplats = Infinity): Promise<CloudBuffers> {
    validateCloud(cloud);
    const where = `scene of ${cloud.count} splats`;
    return withMemoryCheck(device, where, (memory) => new CloudBuffers(device, memory, recentered(cloud), pageSplats));
  }
}

/** Allocates a block of `count` splats, which the stage `ingest` fills. */
export function pageOf(memory: GpuMemory, degree: ShDegree, count: number): GaussianBlock {
  const { storage, copySource } = BUFFER_USAGE;
  const buffer = (name: string, bytes: number): GPUBuffer =>
    memory.buffer(`gs.optimize.${name}`, bytes, storage | copySource);
  return {
    count,
    geometry: buffer('geometry', layouts.PackedGaussian.size * count),
    sh: buffer('sh', 4 * shWords(degree, 'float16') * count),
    chunks: buffer('chunks', layouts.Chunk.size * cullGroups(count)),
  };
}

/** Uploads and packs the splats of a block, from index `first` of the cloud on. Frees the uploaded arrays afterwards. */
function pack(device: GPUDevice, cloud: GaussianCloud, first: number, page: GaussianBlock): void {
  const passing = new GpuMemory(device);
  try {
    const widths = widthsOf(cloud.shDegree);
    const part = (name: keyof typeof widths): GPUBuffer => {
      const numbers = cloud[name].subarray(widths[name] * first, widths[name] * (first + page.count));
      const words = new Uint32Array(numbers.buffer, numbers.byteOffset, numbers.length);
      return passing.buffer(`gs.optimize.${name}`, words.byteLength, BUFFER_USAGE.storage, words);
    };
    const stage = ingestStage(device);
    const bindings = stage.bind({
      ingest: uniformOf(passing, cloud.shDegree, page.count),
      ...{ positions: part('positions'), shapes: part('scales'), rotations: part('rotations') },
      ...{ colors: part('sh'), opacities: part('opacities') },
      ...{ gaussians: page.geometry, sh: page.sh, chunks: page.chunks },
    });
    submitPass(device, 'gs.optimize.pack', (pass) => stage.record(pass, bindings, page.count));
  } finally {
    passing.destroy();
  }
}

/** Returns a uniform buffer of `Ingest` for `count` rows. Each row is a splat. */
function uniformOf(memory: GpuMemory, degree: ShDegree, count: number): GPUBuffer {
  const { positions, scales, rotations, sh, opacities } = widthsOf(degree);
  return uniformWith(memory, 'gs.optimize.ingest', Ingest, {
    ...{ count, rows: count, page_rows: count, first_row: 0, is_half: 0, is_w_first: 1, is_logit: 0 },
    ...{ shape_kind: SHAPE_SCALE, shape_numbers: 3, color_kind: COLOR_COEFFICIENT_MAJOR, sh_degree: degree },
    ...{ positions: [0, positions], shapes: [0, scales], rotations: [0, rotations] },
    ...{ colors: [0, sh], opacities: [0, opacities] },
  });
}
