/** Types of output-file.mjs, for tests. */
export function isSameFile(a: string, b: string): boolean;
export function obstacleTo(path: string): string | undefined;
export function obstacleToFolder(path: string): string | undefined;
export function writeWhole(path: string, content: string | Uint8Array): void;
