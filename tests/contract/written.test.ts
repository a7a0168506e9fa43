/** One rule set, one corpus: this checker finds the same faults in a run's output as the Python exporter's (test_written.py). */
import assert from 'node:assert/strict';
import { readFileSync } from 'node:fs';
import { test } from 'node:test';
import { numberToHalf } from '@gaussian-splat/core';
import {
  checkContract,
  checkOutputs,
  type Contract,
  type OutputBinding,
  type OutputTensor,
} from '@gaussian-splat/core/contract';
import type { OnnxDtype } from '@gaussian-splat/core/onnx';
import { headerWith, tensor } from './support.js';

interface Tensor {
  readonly dims: number[];
  /** Again and again. */
  readonly numbers: readonly number[];
  readonly dtype?: OnnxDtype;
}

/** Changes of a base; null for a tensor that is not there. */
interface Case extends Pick<Contract, 'nMax'> {
  readonly what: string;
  readonly base: string;
  readonly outputs?: Partial<OutputBinding>;
  readonly tensors?: Readonly<Record<string, Tensor | null>>;
  readonly faults: readonly string[];
}

const { bases, cases } = JSON.parse(readFileSync(new URL('../fixtures/written.json', import.meta.url), 'utf8')) as {
  bases: Record<string, { outputs: OutputBinding; tensors: Record<string, Tensor> }>;
  cases: Case[];
};

for (const { what, base, outputs, tensors, nMax, faults } of cases) {
  test(what, () => {
    const binding = { ...bases[base].outputs, ...outputs } as OutputBinding;
    const contract: Contract = { version: 1, inputs: {}, outputs: binding, nMax };
    const named = Object.entries({ ...bases[base].tensors, ...tensors }).flatMap(([name, given]) =>
      given ? [[name, given] as const] : [],
    );
    const header = headerWith(
      [],
      named.map(([name, { dims, dtype }]) => tensor(name, dims, dtype)),
    );
    const written = Object.fromEntries(named.map(([name, given]) => [name, outputOf(given)]));
    const found = [...checkContract(header, contract), ...checkOutputs(contract, written).faults];
    assert.deepEqual([...new Set(found.map(({ code, tensor: name }) => `${code.slice(9)} ${name}`))].sort(), faults);
  });
}

function outputOf({ dims, numbers, dtype = 'float32' }: Tensor): OutputTensor {
  const all = Array.from({ length: dims.reduce((size, dim) => size * dim, 1) }, (_, i) => numbers[i % numbers.length]);
  return { dtype, dims, data: dtype === 'float16' ? Uint16Array.from(all, numberToHalf) : Float32Array.from(all) };
}
