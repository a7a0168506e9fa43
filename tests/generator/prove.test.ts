/** The comparison with the CPU, which sessions of one model share. */
import assert from 'node:assert/strict';
import { test } from 'node:test';
import { prove } from '../../packages/generator/src/cpu-check/prove.js';

type Given = Parameters<typeof prove>;

const model = {
  ...{ bytes: new Uint8Array(8), externalData: [], outputs: [] },
  ...{ contract: {}, header: { operators: new Map() } },
} as unknown as Given[0];
const evidenceOf = (size: number): Given[2] => ({
  ...{ feeds: {}, dims: {} },
  parts: [{ tensor: 'a', dtype: 'float32', offset: 0, size, bytes: new Uint8Array(size) }],
});

test('a session that is closed does not end the comparison of another session of the model', async () => {
  const device = {} as GPUDevice;
  const closed = new AbortController();
  const [first, second] = [closed.signal, new AbortController().signal].map((signal) =>
    prove(model, device, evidenceOf(4), signal),
  );
  closed.abort(new Error('the first was closed'));
  assert.match((await first).reason, /the first was closed/);
  // Node has no runtime at the address that pages have, so the own comparison of the second fails for that reason.
  assert.match((await second).reason, /not compared with the CPU: .*onnxruntime.ort/s);
});

test('a run without rows is no proof, and does not end the search for one', async () => {
  const device = {} as GPUDevice;
  const { signal } = new AbortController();
  const { result, reason } = await prove(model, device, evidenceOf(0), signal);
  assert.deepEqual([result, /wrote no rows/.test(reason)], ['unknown', true]);
  assert.doesNotMatch((await prove(model, device, evidenceOf(4), signal)).reason, /wrote no rows/);
});
