/** An adapter of Dawn in Node, or an error that says what is missing. Run under `gpuEnvironment()`. */
export function requestNodeAdapter(options?: { readonly isTrusted?: boolean }): Promise<GPUAdapter>;
