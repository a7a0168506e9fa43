import type { GaussianBlock, GaussianScene } from '../gaussian-scene.js';
import { constants } from '../generated/shaders.js';
import { perDevice, TEXTURE_USAGE } from '../gpu/kernel.js';
import type { SplatCut } from './cuts.js';

/** The group of each splat of a scene. */
export interface SplatGroupIds {
  /** [G] number of each group, at most 65,536. */
  readonly ids: ArrayLike<number>;
  /** [N] index in {@link ids} of the group of each splat, in the order of the scene on the GPU. */
  readonly of: Uint16Array;
}

const { GROUPS_WIDTH } = constants;
/** Two bytes, which the shader joins. */
const FORMAT = 'rg8unorm';
const TEXEL_BYTES = 2;
const { textureBinding, copyDestination } = TEXTURE_USAGE;

const create = (device: GPUDevice, width: number, height: number): GPUTexture =>
  device.createTexture({
    label: 'gs.modifiers.groups',
    size: [width, height],
    format: FORMAT,
    usage: textureBinding | copyDestination,
  });

/** Returns the texture of scenes without groups. */
export const noGroups = (device: GPUDevice): GPUTextureView =>
  perDevice(device, 'no groups', () => create(device, 1, 1).createView());

/** Textures with the groups of a scene, and the cuts of each group: see shaders/shared/splat_groups.wgsl. */
export class GroupTextures {
  /** Rows with the cuts of groups. */
  readonly rows: number;
  readonly #device: GPUDevice;
  readonly #ids: SplatGroupIds;
  /** Cuts of each group, one bit each. */
  readonly #cuts: Uint16Array<ArrayBuffer>;
  readonly #all: readonly number[];
  readonly #textures = new Map<GaussianBlock, GPUTexture>();
  /** Groups of the cuts that were written last. */
  #written: readonly SplatCut['groups'][] = [];

  constructor(device: GPUDevice, ids: SplatGroupIds) {
    this.#device = device;
    this.#ids = ids;
    this.rows = Math.max(1, Math.ceil(ids.ids.length / GROUPS_WIDTH));
    this.#cuts = new Uint16Array(this.rows * GROUPS_WIDTH);
    this.#all = Array.from({ length: ids.ids.length }, (_, k) => k);
  }

  /** Returns the texture of a block, which is created once. Textures of blocks that the scene lacks are freed. */
  viewOf(block: GaussianBlock, { blocks }: GaussianScene): GPUTextureView {
    for (const [known, texture] of this.#textures) {
      if (blocks.includes(known)) continue;
      texture.destroy();
      this.#textures.delete(known);
    }
    const texture = this.#textures.get(block) ?? this.#create(block, blocks);
    return texture.createView();
  }

  /** Writes which cuts apply to each group. @returns Whether they differ from those before. */
  write(cuts: readonly SplatCut[]): boolean {
    const before = this.#written;
    if (cuts.length === before.length && cuts.every(({ groups }, k) => groups === before[k])) return false;
    this.#written = cuts.map(({ groups }) => groups);
    this.#cuts.fill(0);
    cuts.forEach(({ groups = this.#all }, k) => {
      for (const group of groups) this.#cuts[group] |= 1 << k;
    });
    for (const texture of this.#textures.values()) this.#writeRows(texture, 0, this.#cuts);
    return true;
  }

  destroy(): void {
    for (const texture of this.#textures.values()) texture.destroy();
  }

  #create(block: GaussianBlock, blocks: readonly GaussianBlock[]): GPUTexture {
    const first = blocks.slice(0, blocks.indexOf(block)).reduce((sum, { count }) => sum + count, 0);
    const rows = Math.ceil(block.count / GROUPS_WIDTH);
    const texture = create(this.#device, GROUPS_WIDTH, this.rows + rows);
    const padded = new Uint16Array(rows * GROUPS_WIDTH);
    padded.set(this.#ids.of.subarray(first, first + block.count));
    this.#writeRows(texture, 0, this.#cuts);
    this.#writeRows(texture, this.rows, padded);
    this.#textures.set(block, texture);
    return texture;
  }

  #writeRows(texture: GPUTexture, y: number, texels: Uint16Array<ArrayBuffer>): void {
    const height = texels.length / GROUPS_WIDTH;
    if (height === 0) return;
    const layout = { bytesPerRow: TEXEL_BYTES * GROUPS_WIDTH };
    this.#device.queue.writeTexture({ texture, origin: [0, y] }, texels, layout, [GROUPS_WIDTH, height]);
  }
}
