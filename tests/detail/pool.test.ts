/** Writes to the slots of a pool, through mapped memory or without it. */
import assert from 'node:assert/strict';
import { test } from 'node:test';
import { setTimeout as pause } from 'node:timers/promises';
import type { Vector3 } from '@gaussian-splat/core';
import {
  BLOCK_BYTES,
  BUFFER_USAGE,
  constants,
  DETAIL_NUMBERS,
  emptyList,
  GpuMemory,
  PagePool,
  pageLayout,
  poolBytes,
  poolSize,
  SLOT_CHUNKS,
  StagingBelt,
} from '@gaussian-splat/renderer/stages';
import { randomSource } from '../support/gpu.js';
import { anyDevice } from '../support/node-device.js';
import { readBuffer } from '../support/read-rows.js';

const format = { shDegree: 1, shPrecision: 'int8' } as const;
const SLOTS = 24;
const [chunk, slot] = [pageLayout(format, 1), pageLayout(format, SLOT_CHUNKS)];
const GEOMETRY = chunk.geometry / constants.CULL_GROUP;
/** Pages in which only a chunk's first row moves. */
const quantized = { ...format, geometry: 'quantized' } as const;
const PARTS = ['chunks', 'details', 'geometry', 'sh'] as const;

/** Until blocks whose copies are done are mapped again. */
async function untilMapped(device: GPUDevice): Promise<void> {
  await device.queue.onSubmittedWorkDone();
  await pause(20);
}

for (const [blocks, kind] of [
  [0, format],
  [1, format],
  [3, format],
  [40, format],
  [3, quantized],
] as const) {
  const isQuantized = kind === quantized;
  test(`slots and rows hold what was written to them last, with ${blocks} blocks of mapped memory${isQuantized ? ', quantized' : ''}`, async () => {
    const slot = pageLayout(kind, SLOT_CHUNKS);
    const device = await anyDevice();
    const random = randomSource(7);
    const memory = new GpuMemory(device);
    const pool = new PagePool(device, memory, kind, { slots: SLOTS, blocks });
    const expected = new Float32Array(slot.total * SLOTS);
    const partOf = (part: (typeof PARTS)[number], at: number): Float32Array => {
      const before = PARTS.slice(0, PARTS.indexOf(part)).reduce((sum, name) => sum + slot[name] * SLOTS, 0);
      return expected.subarray(before + slot[part] * at, before + slot[part] * (at + 1));
    };
    await untilMapped(device);
    for (let frame = 0; frame < 8; frame++) {
      for (let k = 0; k < 9; k++) {
        // Some slots are written twice before they are drawn.
        const at = Math.floor(random() * (k < 3 ? 4 : SLOTS));
        const numbers = Float32Array.from({ length: slot.total }, () => random());
        const by: Vector3 = k % 2 === 0 ? [0, 0, 0] : [Math.fround(random()), 2, -1];
        const words = new Uint32Array(numbers.buffer);
        pool.write(at, { words, of: SLOT_CHUNKS, first: 0, chunks: SLOT_CHUNKS }, by);
        let from = 0;
        for (const part of PARTS) {
          const own = numbers.slice(from, (from += slot[part]));
          const stride = part === 'chunks' ? 4 : isQuantized ? slot.geometry / SLOT_CHUNKS : GEOMETRY;
          for (let first = 0; (part === 'chunks' || part === 'geometry') && first < own.length; first += stride) {
            by.forEach((shift, axis) => (own[first + axis] += shift));
          }
          if (part !== 'details') partOf(part, at).set(own);
        }
      }
      const [first, count] = [Math.floor(random() * 8), 1 + Math.floor(random() * 16)];
      const rows = Float32Array.from({ length: DETAIL_NUMBERS * SLOT_CHUNKS * count }, () => random());
      pool.writeDetails(first, rows);
      for (let k = 0; k < count; k++)
        partOf('details', first + k).set(rows.subarray(slot.details * k, slot.details * (k + 1)));
      pool.flush();
      for (const part of PARTS) {
        const found = new Float32Array(await readBuffer(pool.pages[0][part]!));
        for (let at = 0; at < SLOTS; at++) {
          const own = found.subarray(slot[part] * at, slot[part] * (at + 1));
          assert.deepEqual(own, partOf(part, at), `${part} of slot ${at} after frame ${frame}`);
        }
      }
    }
    assert.equal(pool.pages.length, 1);
    memory.destroy();
  });
}

test('a belt takes as much as its blocks hold, and they come back when what they held has been copied', async () => {
  const device = await anyDevice();
  const memory = new GpuMemory(device);
  const belt = new StagingBelt(memory, 'test', 2);
  const words = Uint32Array.from({ length: BLOCK_BYTES / 4 + 300 }, (_, k) => 3 * k + 1);
  const to = memory.buffer('to', 4 * words.length, BUFFER_USAGE.copyDestination | BUFFER_USAGE.copySource);
  assert.equal(belt.write(to, 0, words), 0, 'nothing is mapped yet');
  for (let turn = 0; turn < 3; turn++) {
    await untilMapped(device);
    assert.equal(belt.isEmpty, true);
    assert.equal(belt.write(to, 0, words), words.length, 'over the end of a block');
    assert.equal(belt.write(to, 0, words), 2 * (BLOCK_BYTES / 4) - words.length, 'what is left of the second');
    const encoder = device.createCommandEncoder();
    belt.record(encoder);
    device.queue.submit([encoder.finish()]);
    belt.recall();
    assert.equal(belt.write(to, 0, words), 0, 'all are on their way');
  }
  assert.deepEqual(new Uint32Array(await readBuffer(to)), words);
  memory.destroy();
  await untilMapped(device);
});

test('a pool and what its uploads pass through stay within the budget, which small ones spend on slots alone', () => {
  const list = emptyList(new Uint32Array(5_000).fill(1));
  const bytes = 4 * slot.total;
  for (const budget of [bytes, 5e6, 64e6, 150e6, 1e9]) {
    const size = poolSize(format, list, budget);
    assert.ok(poolBytes(format, size) <= budget, `${budget}: ${JSON.stringify(size)}`);
    const left = budget - poolBytes(format, size);
    assert.ok(size.slots === list.count || left < bytes, `${budget}: ${left} bytes are left`);
    assert.equal(size.blocks > 0, budget > 8.4e6);
    assert.ok(size.blocks * BLOCK_BYTES <= budget / 32);
  }
  assert.throws(() => poolSize(format, list, bytes - 1), /out-of-memory\/budget/);
});
