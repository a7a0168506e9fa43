/** Inputs that the checker runs a model with. */
import assert from 'node:assert/strict';
import { test } from 'node:test';
import type { Contract, GaussiansInput } from '@gaussian-splat/core/contract';
import { checkContract } from '@gaussian-splat/core/contract';
import { sampleInputs } from '../../packages/check/src/sample-inputs.js';
import { headerWith, PACKED, tensor } from '../contract/support.js';

/** Every attribute of the Gaussians of another model, in every shape that a contract allows. */
const SHAPES: readonly [GaussiansInput, ...(number | string)[][]][] = [
  [{ role: 'gaussians', attribute: 'packed', color: 'rgb', opacityActivation: 'logit' }, ['N', 13], [1, 'N', 13]],
  [{ role: 'gaussians', attribute: 'positions' }, ['N', 3], [1, 'N', 3], [1, 5, 3]],
  [{ role: 'gaussians', attribute: 'covariances' }, ['N', 6], ['N', 3, 3], [1, 'N', 3, 3]],
  [{ role: 'gaussians', attribute: 'scales', scaleActivation: 'log' }, ['N', 3], ['N', 1], ['N'], [1, 'N', 1]],
  [{ role: 'gaussians', attribute: 'rotations', rotationOrder: 'xyzw' }, ['N', 4], [1, 'N', 4]],
  [{ role: 'gaussians', attribute: 'colors' }, ['N', 3], ['N', 4], [1, 'N', 4]],
  [{ role: 'gaussians', attribute: 'sh', shOrder: 'channel-major' }, ['N', 3, 4], ['N', 27], [1, 'N', 3, 16]],
  [{ role: 'gaussians', attribute: 'opacities', opacityActivation: 'linear' }, ['N'], ['N', 1], [1, 'N', 1]],
];

for (const [binding, ...shapes] of SHAPES) {
  test(`Gaussians of another model, ${binding.attribute}: as many numbers as each shape has`, () => {
    for (const dims of shapes) {
      const header = headerWith([tensor('given', dims)], [tensor('gaussians', [100, 13])]);
      const contract: Contract = { ...PACKED, inputs: { given: binding } };
      assert.deepEqual(checkContract(header, contract), [], String(dims));
      for (const { inputs } of sampleInputs(header, contract)) {
        const { given } = inputs;
        const size = given.dims.reduce((product, dim) => product * dim, 1);
        assert.deepEqual([given.data.length, Number.isFinite(given.data.at(-1))], [size, true], String(dims));
      }
    }
  });
}
