import { constants } from '@gaussian-splat/renderer/stages';
import { checkEqual, randomSource, type Bench, type StageCase } from '../../support/gpu.js';
import { scanOnGpu } from '../../support/scan.js';

/** The twin: exclusive prefix sums modulo 2^32, and behind them the total. */
function scanTwin(values: Uint32Array): Uint32Array {
  const sums = new Uint32Array(values.length + 1);
  values.forEach((value, i) => (sums[i + 1] = sums[i] + value));
  return sums;
}

async function checkScan(bench: Bench, values: Uint32Array): Promise<void> {
  for (const threads of ['parallel', 'serial'] as const) {
    checkEqual(await scanOnGpu(bench, values, threads), scanTwin(values), `${threads} prefix sums`);
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
