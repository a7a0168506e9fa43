import { loadModule } from '@gaussian-splat/core';
import { perDevice } from '../gpu/kernel.js';
import type { FewTiles } from './few-tiles.js';
import type { RasterizeVariant } from './tile-kernels.js';

/** Kernels for images of few tiles. They are loaded, compiled and tested while other kernels draw the same images. */
export interface FewTilesLoader {
  /** Undefined before, and on a device that draws wrong images with them. */
  now?: FewTiles;
  /** Starts to load the kernels. Their lack costs time alone, so a failure is not reported. */
  load(): void;
  /** Compiles the pipelines of a variant, now or with the load. */
  prepare(variant: RasterizeVariant): void;
}

export const fewTilesOn = (device: GPUDevice): FewTilesLoader =>
  perDevice(device, 'few tiles', () => {
    const wanted: RasterizeVariant[] = [];
    const load = async (): Promise<void> => {
      const { loadFewTiles } = await import('./few-tiles.js');
      await loadFewTiles(device, lazy, wanted);
    };
    let loading: Promise<void> | undefined;
    const lazy: FewTilesLoader = {
      load() {
        // Software adapters have few threads: more workgroups only cost them time.
        if (device.adapterInfo?.isFallbackAdapter) return;
        loading ??= loadModule('the code for small images', load).catch(() => undefined);
      },
      prepare(variant) {
        wanted.push(variant);
        lazy.now?.prepare(variant);
      },
    };
    return lazy;
  });
