/**
 * `node --import tsx read-measured.ts FILE BESIDE …` reads files, each with one beside it or with '', those named `.mesh` for their triangles, in a process of their own, the cheapest first, and prints the cost of each as a line of JSON: the number of blocks of JavaScript that ran, and the peak memory of the process beyond its memory before.
 */
import { existsSync, readFileSync } from 'node:fs';
import { Session, type Profiler } from 'node:inspector';
import { framePath, isSequence, LoadBudget, parseSequence, readScene, readTriangles } from '@gaussian-splat/formats';

async function read(file: Uint8Array, beside: string, isMesh: boolean): Promise<string> {
  if (isMesh) {
    const openUri = async (): Promise<Uint8Array> => new Uint8Array(readFileSync(beside));
    const { triangles } = await readTriangles({ bytes: file, name: 'a', budget: new LoadBudget(file.length), openUri });
    return `${triangles} triangles`;
  }
  if (isSequence(file)) {
    const sequence = parseSequence(file, 'a');
    return `${sequence.frameCount} frames, ${framePath(sequence, sequence.frameCount - 1).length} characters`;
  }
  const openFile = existsSync(beside) ? async () => new Uint8Array(readFileSync(beside)) : undefined;
  return `${(await readScene(file, { name: 'a', openFile })).count} splats`;
}

/**
 * Peak memory until now in bytes. `resourceUsage` may report the parent process; on Linux the process's own peak is
 * known.
 */
function peakSoFar(): number {
  const status = existsSync('/proc/self/status') ? readFileSync('/proc/self/status', 'utf8') : '';
  return 1024 * Number(/VmHWM:\s*(\d+)/.exec(status)?.[1] ?? process.resourceUsage().maxRSS);
}

const session = new Session();
session.connect();
session.post('Profiler.enable');
session.post('Profiler.startPreciseCoverage', { callCount: true, detailed: true });

/** Returns how often blocks of JavaScript ran since the last call: iterations of loops and calls of functions, not native code. */
function blocksRun(): number {
  let found: Profiler.ScriptCoverage[] = [];
  session.post('Profiler.takePreciseCoverage', (_, { result }) => (found = result));
  const ranges = found.flatMap(({ functions }) => functions.flatMap((each) => each.ranges));
  return ranges.reduce((sum, { count }) => sum + count, 0);
}

async function measure(path: string, beside: string): Promise<void> {
  const file = new Uint8Array(readFileSync(path));
  const before = process.memoryUsage().rss;
  blocksRun();
  const result = await read(file, beside, path.endsWith('.mesh')).catch(
    (error: { code?: string; message?: string }) => error.code ?? `unnamed: ${error.message}`,
  );
  const peak = peakSoFar() - before;
  console.log(JSON.stringify({ blocks: blocksRun(), peak, result }));
}

const paths = process.argv.slice(2);
for (let i = 0; i < paths.length; i += 2) await measure(paths[i], paths[i + 1]);
