/** Scenes of configurations, loaded once each: clouds, buffers on the GPU, PLY files for peers. */
import { fetchScene, readScene } from '@gaussian-splat/formats';
import { writePly } from '../peers/ply.js';
import { placeCopies } from '../scene/placement.js';
import { watchOptions } from './levers.js';
import { firstSplats, tileCloud, uploadTiled } from '../scene/tiling.js';

/** Configurations with the same key draw the same splats from the same bytes of memory. */
export const sceneKey = ({ scene, splats, layout, visible, mode }) =>
  JSON.stringify([scene, splats, layout, layout === 'overhead' && visible, mode]);

const clouds = new Map();

async function loadCloud({ scene, mode }) {
  const url = new URL(scene, location.href).href;
  if (!clouds.has(url))
    clouds.set(
      url,
      fetchScene(url).then((bytes) => readScene(bytes, { name: scene })),
    );
  const cloud = await clouds.get(url);
  return mode === 'scene' ? cloud : { ...cloud, antialiased: mode === 'antialiased' };
}

/** One scene, held as long as configurations need it. */
export class BenchScene {
  #device;
  #cloud;
  #copies;
  #uploads = new Map();
  #ply;

  /** The configuration's scene, loaded and placed, nothing uploaded yet. */
  static async load(device, configuration) {
    const cloud = await loadCloud(configuration);
    const { splats, layout, visible } = configuration;
    const { radius, copies } = placeCopies({ base: cloud.count, count: splats, layout, visible });
    return new BenchScene(device, cloud, copies, radius);
  }

  constructor(device, cloud, copies, radius) {
    this.#device = device;
    this.#cloud = copies.length === 1 ? firstSplats(cloud, copies[0].length) : cloud;
    this.#copies = copies;
    this.radius = radius;
    this.antialiased = cloud.antialiased;
    this.count = copies.reduce((sum, { length }) => sum + length, 0);
  }

  /** The scene's first `most` splats as one cloud: 240 bytes of memory for each with harmonics of degree 3. */
  cloud(max = this.count) {
    const copies = [];
    for (let left = max, i = 0; left > 0 && i < this.#copies.length; i++) {
      const { offset, length } = this.#copies[i];
      copies.push({ offset, length: Math.min(length, left) });
      left -= length;
    }
    return tileCloud(this.#cloud, copies);
  }

  /**
   * The scene on the GPU, packed with the given options.
   * @returns {Promise<{buffers: GaussianBuffers[], ignored: string[]}>} with the pack options that were not read.
   */
  upload(pack) {
    const key = JSON.stringify(pack);
    if (!this.#uploads.has(key)) this.#uploads.set(key, this.#upload(pack));
    return this.#uploads.get(key);
  }

  async #upload(pack) {
    const { options, unread } = watchOptions(pack);
    const buffers = await uploadTiled(this.#device, this.#cloud, this.#copies, options);
    return { buffers, ignored: unread() };
  }

  /** The scene as a PLY file for other renderers. */
  ply() {
    return (this.#ply ??= writePly(this.#cloud, this.#copies));
  }

  async destroy() {
    for (const upload of this.#uploads.values()) (await upload).buffers.forEach((buffers) => buffers.destroy());
    this.#uploads.clear();
  }
}
