import { constants, scanBytes, ScanStage } from '@gaussian-splat/renderer/stages';
import { checkEqual, randomSource, type Bench, type StageCase } from '../../support/gpu.js';

/** The twin: exclusive prefix sums modulo 2^32, and behind them the total. */
function scanTwin(values: Uint32Array): Uint32Array {
  const sums = new Uint32Array(values.length + 1);
  values.forEach((value, i) => (sums[i + 1] = sums[i] + value));
  return sums;
}

async function checkScan(bench: Bench, values: Uint32Array): Promise<void> {
  for (const threads of ['parallel', 'serial'] as const) {
    const stage = new ScanStage(bench.device, threads);
    const words = new Uint32Array(scanBytes(values.length) / 4);
    words.set(values);
    const buffer = bench.buffer(words);
    const bindings = stage.bind({ values: buffer, scan: bench.uniform(values.length) });
    bench.compute((pass) => stage.record(pass, bindings));
    const sums = (await bench.read(buffer)).subarray(0, values.length + 1);
    checkEqual(sums, scanTwin(values), `${threads} prefix sums`);
  }
}

const step = constants.PREFIX_THREADS * constants.PER_THREAD;

export const scanCases: StageCase[] = [
  ...[0, 1, 15, 16, 17, 255, step - 1, step, step + 1, 5 * step + 123].map((size) => ({
    name: `scan: ${size} random counts`,
    run: (bench: Bench) => {
      const random = randomSource(size + 3);
      return checkScan(
        bench,
        Uint32Array.from({ length: size }, () => Math.floor(random() * 257)),
      );
    },
  })),
  {
    name: 'scan: all groups full, all empty, one full at the end',
    run: async (bench) => {
      await checkScan(bench, new Uint32Array(step + 5).fill(256));
      await checkScan(bench, new Uint32Array(step + 5));
      await checkScan(
        bench,
        Uint32Array.from({ length: step + 5 }, (_, i) => (i === step + 4 ? 256 : 0)),
      );
    },
  },
];
