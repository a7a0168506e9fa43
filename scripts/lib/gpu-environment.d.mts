/** Variables for a child process that uses Dawn in Node; see gpu-environment.mjs. */
export function gpuEnvironment(): Record<string, string>;
