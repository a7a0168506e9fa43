import { ingest } from '../generated/live-shaders.js';
import { constants } from '../generated/shaders.js';
import { Stage } from './stage.js';

/** Tensors of a generator to packed Gaussians of a page, of which each row for which the page has room is written. */
export const ingestStage = (device: GPUDevice): Stage<typeof ingest> => new Stage(device, ingest, constants.CULL_GROUP);
