/** Contracts and headers that several tests of the contract start from. */
import assert from 'node:assert/strict';
import { ContractError, type Contract, type ContractFault } from '@gaussian-splat/core/contract';
import type { OnnxHeader, OnnxTensor } from '@gaussian-splat/core/onnx';

export const PACKED: Contract = {
  version: 1,
  inputs: { time: { role: 'time', unit: 'seconds' } },
  outputs: { layout: 'packed', gaussians: 'gaussians', color: 'rgb', opacityActivation: 'linear' },
};

export const SPLIT: Contract = {
  version: 1,
  inputs: {},
  outputs: {
    layout: 'split',
    positions: 'p',
    scales: 's',
    scaleActivation: 'log',
    rotations: 'r',
    rotationOrder: 'wxyz',
    sh: 'h',
    shOrder: 'coefficient-major',
    opacities: 'o',
    opacityActivation: 'logit',
    count: 'c',
  },
};

export const tensor = (name: string, dims: OnnxTensor['dims'], dtype: OnnxTensor['dtype'] = 'float32'): OnnxTensor => ({
  name,
  dtype,
  dims,
});

export const SPLIT_OUTPUTS: readonly OnnxTensor[] = [
  tensor('p', [10, 3]),
  tensor('s', [10, 3]),
  tensor('r', [10, 4]),
  tensor('h', [10, 9, 3]),
  tensor('o', [10, 1]),
  tensor('c', [1], 'int32'),
];

/** A header that is in order in all that a test does not say. */
export function headerWith(
  inputs: readonly OnnxTensor[],
  outputs: readonly OnnxTensor[],
  rest: Partial<OnnxHeader> = {},
): OnnxHeader {
  return {
    name: 'model.onnx',
    byteLength: 1000,
    irVersion: 8,
    producer: 'test',
    graphName: '',
    opsets: new Map([['ai.onnx', 17]]),
    metadata: new Map(),
    inputs,
    optionalInputs: [],
    outputs,
    operators: new Map(),
    functions: new Set(),
    externalFiles: [],
    nodes: [],
    stored: new Map(),
    values: new Map(),
    initializerBytes: 0,
    ...rest,
  };
}

/** The faults that an action throws; fails if it throws none. */
export function faultsOf(action: () => unknown): readonly ContractFault[] {
  try {
    action();
  } catch (error) {
    assert.ok(error instanceof ContractError, String(error));
    assertHelpful(error.faults);
    return error.faults;
  }
  return assert.fail('no ContractError');
}

/** Every phrase of a fault is there and reads well. */
export function assertHelpful(faults: readonly ContractFault[]): void {
  for (const { code, where, expected, found, remedy } of faults) {
    assert.match(code, /^contract\//);
    for (const part of [where, expected, found, remedy]) {
      // A message must report NaN values.
      const broken = code === 'contract/not-finite' ? /undefined|\[object/ : /undefined|NaN|\[object/;
      assert.ok(part.length > 0 && !broken.test(part), `${code} at ${where}: ${part}`);
    }
    assert.ok(`${where}${expected}${found}${remedy}`.length < 600, `${where} is long`);
  }
}

/** `code where` of each fault, sorted. */
export const brief = (faults: readonly ContractFault[]): string[] =>
  faults.map(({ code, tensor: name, where }) => `${code.slice(9)} ${name ?? where}`).sort();
