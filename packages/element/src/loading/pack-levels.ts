/** Packs scenes with their own levels of detail. The module is loaded only for such files. */
import { boundsOf, type GaussianCloud } from '@gaussian-splat/core';
import { packLevelRuns } from '@gaussian-splat/renderer/tools';
import type { LoadedScene, SceneRequest } from './protocol.js';

export const packLevels = (cloud: GaussianCloud, sh: SceneRequest['sh']): LoadedScene => ({
  packed: packLevelRuns(cloud, { sh }),
  bounds: { ...boundsOf(cloud), ...cloud.hints },
  warnings: cloud.warnings,
  credits: cloud.hints?.credits,
});
