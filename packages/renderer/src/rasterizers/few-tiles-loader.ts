import { loadModule } from '@gaussian-splat/core';
import { madeTogether, perDevice } from '../gpu/kernel.js';
import { PREFERRED } from '../variants.js';
import type { FewTiles } from './few-tiles.js';
import { FEW_STAGES, type RasterizeVariant } from './tile-kernels.js';

/** Minimum number of splats of a segment in the self-test, whose lists are short. */
const TESTED_SPLATS = 16;

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
    const prepare = (few: FewTiles | undefined, variant: RasterizeVariant): void => {
      for (const stage of FEW_STAGES) few?.kernel(variant, stage).prepare();
    };
    const load = async (): Promise<void> => {
      const [{ FewTiles }, { passes }] = await Promise.all([import('./few-tiles.js'), import('../autotune/timing.js')]);
      const make = async (splats?: number): Promise<void> => {
        let few: FewTiles | undefined;
        await madeTogether(device, () => {
          few = new FewTiles(device, splats);
          for (const variant of wanted) prepare(few, variant);
        });
        lazy.now = few;
      };
      await make(TESTED_SPLATS);
      if (await passes(device, PREFERRED, undefined, 'divided lists')) await make();
      else lazy.now = undefined;
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
        prepare(lazy.now, variant);
      },
    };
    return lazy;
  });
