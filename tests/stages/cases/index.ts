import type { StageCase } from '../../support/gpu.js';
import { compactCases } from './compact.js';
import { scanCases } from './scan.js';
import { sortCases } from './sort.js';

export const stageCases: readonly StageCase[] = [...scanCases, ...compactCases, ...sortCases];
