/**
 * `node --import tsx read-measured.ts FILE [BESIDE]` reads a file in a process of its own, and prints what that cost as JSON: milliseconds of CPU, and the most memory that the process
 * had beyond what it began with.
 */
import { existsSync, readFileSync } from 'node:fs';
import { framePath, isSequence, parseSequence, readScene } from '@gaussian-splat/formats';

const [, , path, beside] = process.argv;
const file = new Uint8Array(readFileSync(path));

async function read(): Promise<string> {
  if (isSequence(file)) {
    const sequence = parseSequence(file, 'a');
    return `${sequence.frameCount} frames, ${framePath(sequence, sequence.frameCount - 1).length} characters`;
  }
  const openPart = existsSync(beside) ? async () => new Uint8Array(readFileSync(beside)) : undefined;
  return `${(await readScene(file, { name: 'a', openPart })).count} splats`;
}

/** Most memory so far, bytes. What `resourceUsage` tells may be that of the process which started this one; on Linux its own is known. */
function peakSoFar(): number {
  const status = existsSync('/proc/self/status') ? readFileSync('/proc/self/status', 'utf8') : '';
  return 1024 * Number(/VmHWM:\s*(\d+)/.exec(status)?.[1] ?? process.resourceUsage().maxRSS);
}

const before = process.memoryUsage().rss;
const start = process.cpuUsage();
const result = await read().catch(
  (error: { code?: string; message?: string }) => error.code ?? `unnamed: ${error.message}`,
);
const { user, system } = process.cpuUsage(start);
const peak = peakSoFar() - before;
console.log(JSON.stringify({ cpuMs: (user + system) / 1000, peak, result }));
