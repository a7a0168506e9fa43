import { takeSplats } from '../take-splats.js';
import { putColumns } from '../write/glb-columns.js';
import { readPart } from './read-part.js';

/** All that can be done in parts, by name. What a task changes lies in memory that its input brings. */
export const tasks = { takeSplats, putColumns, readPart } as const;
