import type { Threads } from '@gaussian-splat/renderer/tools';
import { layouts, planStage, scanBytes } from '@gaussian-splat/renderer/stages';
import type { Bench } from './gpu.js';

/** Exclusive prefix sums of numbers as the stage `plan` makes them, and behind them the total. */
export async function scanOnGpu(bench: Bench, values: ArrayLike<number>, threads: Threads): Promise<Uint32Array> {
  const { length } = values;
  const stage = planStage(bench.device, threads);
  const words = new Uint32Array(scanBytes(length) / 4);
  words.set(values);
  const buffer = bench.buffer(words);
  const bindings = stage.bind({
    values: buffer,
    limits: bench.uniform(1, 0xffffffff, length),
    page_ranges: bench.buffer(Uint32Array.of(0, length)),
    plan: bench.buffer(layouts.Plan.size + layouts.PagePlan.size),
  });
  bench.compute((pass) => stage.record(pass, bindings));
  return bench.read(buffer, 4 * (length + 1));
}
