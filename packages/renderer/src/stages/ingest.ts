import { ingest } from '../generated/live-shaders.js';
import { constants } from '../generated/shaders.js';
import { Stage } from './stage.js';

/**
 * Returns the stage that packs the tensors of a generator into the Gaussians of a block. It writes every row of the
 * block.
 */
export const ingestStage = (device: GPUDevice): Stage<typeof ingest> => new Stage(device, ingest, constants.CULL_GROUP);
