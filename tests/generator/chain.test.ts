/** Connections of the models of a chain: the shapes of the tensors between them. */
import assert from 'node:assert/strict';
import { test } from 'node:test';
import type { Contract, GaussianLayout } from '@gaussian-splat/core/contract';
import type { GeneratorModel } from '@gaussian-splat/generator';
import { connect } from '../../packages/generator/src/chain/connect.js';
import { HandOver } from '../../packages/generator/src/chain/hand-over.js';
import { headerWith, PACKED, tensor } from '../contract/support.js';

/** A device whose buffers have a size and no content. */
const device = {
  createBuffer: ({ size }: GPUBufferDescriptor) => ({ size, destroy: () => undefined }),
  createCommandEncoder: () => ({ copyBufferToBuffer: () => undefined, finish: () => undefined }),
  queue: { submit: () => undefined, writeBuffer: () => undefined },
} as unknown as GPUDevice;

function modelOf(inputs: Parameters<typeof headerWith>[0], contract: Contract): GeneratorModel {
  const header = headerWith(inputs, [tensor('gaussians', [10, 13])]);
  const layout = { capacity: 10 } as GaussianLayout;
  const outputs = [{ name: 'gaussians', kind: 'gaussians', dtype: 'float32', max: 130 } as const];
  return { url: '', header, contract, layout, outputs, notes: [], bytes: new Uint8Array(0), externalData: [] };
}

test('the number of rows has the rank that the next model takes it in', () => {
  const role = 'gaussians';
  const packed = { role, attribute: 'packed', color: 'rgb', opacityActivation: 'linear' } as const;
  const inputs: Contract['inputs'] = { given: packed, live: { role, attribute: 'count' } };
  for (const dims of [[], [1], [1, 1]]) {
    const before = modelOf([], { ...PACKED, inputs: {} });
    const after = modelOf([tensor('given', [10, 13]), tensor('live', dims, 'int32')], { ...PACKED, inputs });
    const between = new HandOver(device, before, connect(before, after));
    const buffer = device.createBuffer({ size: 520, usage: 0 });
    between.take({ tensors: { gaussians: buffer }, dims: { gaussians: [10, 13] }, rows: 10 });
    assert.deepEqual(between.tensors.live.dims, dims);
  }
});
