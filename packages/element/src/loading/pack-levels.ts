/** Packs scenes with their own levels of detail. The module is loaded only for such files. */
import { boundsOf, type GaussianCloud } from '@gaussian-splat/core';
import { innerViewOf } from '@gaussian-splat/core/views';
import { packLevelRuns } from '@gaussian-splat/renderer/tools';
import type { LoadedScene, SceneRequest } from './protocol.js';

export function packLevels(cloud: GaussianCloud, sh: SceneRequest['sh']): LoadedScene {
  const bounds = boundsOf(cloud);
  return {
    packed: packLevelRuns(cloud, { sh }),
    bounds: { ...bounds, inside: innerViewOf(cloud, bounds), ...cloud.hints },
    warnings: cloud.warnings,
    credits: cloud.hints?.credits,
  };
}
