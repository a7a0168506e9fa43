import type { StageCase } from '../../support/gpu.js';
import { compactCases } from './compact.js';
import { detailCases } from './detail.js';
import { ingestCases } from './ingest.js';
import { portionCases } from './portions.js';
import { probeCases } from './probe.js';
import { projectionCases } from './projection.js';
import { roundedApartCases } from './rounded-apart.js';
import { scanCases } from './scan.js';
import { sortCases } from './sort.js';

export const stageCases: readonly StageCase[] = [
  ...scanCases,
  ...projectionCases,
  ...roundedApartCases,
  ...compactCases,
  ...detailCases,
  ...probeCases,
  ...sortCases,
  ...ingestCases,
  ...portionCases,
];
