/** Returns an adapter of Dawn in Node. Throws an error that describes the remedy if there is none. */
export function requestNodeAdapter(options?: { readonly isTrusted?: boolean }): Promise<GPUAdapter>;
