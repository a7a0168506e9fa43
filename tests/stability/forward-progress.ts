/**
 * S14. Loops that wait for another workgroup.
 *
 * Who fails: decoupled look-back spins until a neighbor has written; WebGPU promises no such progress. Visionary still does (`while true` in its source), web-splat
 * froze machines with M-series chips (MarcusAndreasSvensson/gaussian-splatting-webgpu #10), PlayCanvas found its one-sweep wrong on Mali, IMG and Adreno.
 *
 * Recipe: asked for a check of the text, a software adapter, and one thread. Run so.
 *
 * Passes: no loop of any shader reads what another workgroup may write at the same time; the sort ends and is right with barriers and, in the `serial` variant,
 * without.
 */
import { test } from 'node:test';
import assert from 'node:assert/strict';
import { constants, SortStage } from '@gaussian-splat/renderer/stages';
import { checkEqual, randomSource, runCase } from '../support/gpu.js';
import { nodeDevice } from '../support/node-device.js';
import { holds, note, sized } from './support/row.js';
import { planFor, stableOrder } from './support/sorting.js';
import { loopBodies, shaderTexts } from './support/sources.js';

test('no loop waits', () => {
  const faults: string[] = [];
  let loops = 0;
  for (const [name, text] of shaderTexts()) {
    // Atomics in storage are the only communication between workgroups within a dispatch.
    const storage = [...text.matchAll(/var<storage, read_write>\s+(\w+):[^;]*atomic/g)].map(([, variable]) => variable);
    for (const body of loopBodies(text)) {
      loops++;
      if (/^(?:loop|while)\b/.test(body) && !/\bbreak\b|^while\s*\((?:[^()]|\((?:[^()]|\([^()]*\))*\))*[<>]/.test(body))
        faults.push(`${name}: ${body.slice(0, 60)}`);
      if (/while\s*\(\s*true|for\s*\(\s*;\s*;/.test(body)) faults.push(`${name}: ${body.slice(0, 60)}`);
      for (const variable of storage) {
        if (new RegExp(`atomic(?:Load|CompareExchangeWeak)\\s*\\(\\s*&${variable}\\b`).test(body))
          faults.push(`${name}: reads ${variable} in a loop`);
      }
    }
  }
  assert.ok(loops > 20, `${loops} loops were found`);
  holds('S14', 'loops that could wait for another workgroup', faults.length, {
    atMost: 0,
    unit: faults.join('; ') || 'loops',
  });
});

for (const name of ['parallel', 'serial'] as const) {
  test(`the sort ends, ${name}`, async () => {
    const device = await nodeDevice();
    const count = sized(12, 300) * constants.SORT_BLOCK + 17;
    const random = randomSource(14);
    const keys = Uint32Array.from({ length: count }, () => Math.floor(random() * 0x1_0000_0000));
    await runCase(device, {
      name,
      async run(bench) {
        const stage = new SortStage(device, name);
        const plan = bench.buffer(planFor(count));
        const order = [bench.buffer(4 * count), bench.buffer(4 * count)] as const;
        const bindings = stage.bind({
          plan,
          keys: [bench.buffer(keys), bench.buffer(4 * count)],
          values: order,
          digitCounts: bench.buffer(4 * constants.DIGITS * Math.ceil(count / constants.SORT_BLOCK)),
          digitTotals: bench.buffer(4 * constants.DIGITS),
        });
        const start = performance.now();
        bench.compute((pass) => stage.record(pass, bindings, count));
        checkEqual(await bench.read(order[0]), stableOrder(keys), 'order');
        note('S14', `${count} keys, ${name}, with reading back`, performance.now() - start, { unit: 'ms' });
      },
    });
  });
}
