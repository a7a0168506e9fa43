import { findPartners } from '../merge/pair-candidates.js';
import { orderAll } from '../order.js';
import { putRows } from '../put-rows.js';
import { takeSplats } from '../take-splats.js';
import { putColumns } from '../write/glb-columns.js';
import { readPart } from './read-part.js';

/** All that can be done in parts, by name. What a task changes lies in memory that its input brings. */
export const tasks = { orderAll, takeSplats, putRows, putColumns, readPart, findPartners } as const;
