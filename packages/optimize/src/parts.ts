/** Entry point for threads that run parallel tasks. It does not load the renderer. */
export { gatherParts } from './parts/read-in-parts.js';
export { readBlocks, type PartRead } from './parts/read-part.js';
export type { Part } from './parts/cloud-memory.js';
export { inline, type TaskInput, type TaskName, type TaskPool, type TaskResult } from './parts/task-pool.js';
export { tasks } from './parts/tasks.js';
