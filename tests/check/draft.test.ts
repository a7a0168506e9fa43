/** Drafts of contracts: the contract that a file's names and shapes allow is one that the file keeps. */
import assert from 'node:assert/strict';
import { test } from 'node:test';
import { checkContract, parseContract } from '@gaussian-splat/core/contract';
import { draftContract } from '@gaussian-splat/check';
import { headerWith, tensor } from '../contract/support.js';
import { fixtureHeader } from '../support/generators.js';

for (const name of ['packed.onnx', 'packed-sh-half.onnx', 'split.onnx', 'canonical.onnx', 'post.onnx', 'shaped.onnx']) {
  test(`the draft for ${name} is a contract that the file keeps`, async () => {
    const header = await fixtureHeader(name);
    const { contract } = draftContract(header);
    const faults = checkContract(header, parseContract(JSON.stringify(contract)));
    assert.deepEqual(faults, []);
  });
}

test('cameras, intrinsics and rotation matrices are known by their names and shapes', async () => {
  const { inputs } = draftContract(await fixtureHeader('shaped.onnx')).contract;
  const roles = Object.fromEntries(Object.entries(inputs).map(([name, { role }]) => [name, role]));
  assert.deepEqual(roles, { time: 'time', c2w: 'camera_to_world', k: 'intrinsics', pose: 'pose' });
});

test('a row of LGM is known by its 14 numbers, and asked about', () => {
  const header = headerWith([tensor('time', [1])], [tensor('out', [1, 100, 14])]);
  const { contract, questions } = draftContract(header);
  assert.deepEqual(checkContract(header, parseContract(JSON.stringify(contract))), []);
  assert.ok(questions.some((question) => question.includes('LGM')));
});

test('a role that fits several inputs is drafted once, and a whole number only for a tensor of whole numbers', () => {
  const inputs = [tensor('body_pose', [21, 3]), tensor('hand_pose', [30, 3]), tensor('time', [1]), tensor('t', [1])];
  inputs.push(tensor('frame', [1]), tensor('seed', [1], 'int64'));
  const header = headerWith(inputs, [tensor('out', [100, 13])]);
  const { contract } = draftContract(header);
  assert.deepEqual(checkContract(header, parseContract(JSON.stringify(contract))), []);
  const roles = Object.values(contract.inputs).map(({ role }) => role);
  assert.deepEqual(roles, ['pose', 'control', 'time', 'control', 'control', 'seed']);
});
