/**
 * How a stage shares its work: `parallel`, one thread for each item, as GPUs want it; `serial`, a run of items for each thread and no
 * barriers, for adapters that are a processor in disguise (SwiftShader, llvmpipe, WARP).
 */
export type Threads = 'parallel' | 'serial';
