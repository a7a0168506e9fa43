import { ingest } from '../generated/live-shaders.js';
import { constants } from '../generated/shaders.js';
import { Stage } from './stage.js';

/** Packs tensors of a generator into the Gaussians of a block; every row of the block is written. */
export const ingestStage = (device: GPUDevice): Stage<typeof ingest> => new Stage(device, ingest, constants.CULL_GROUP);
