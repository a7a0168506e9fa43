/** A page's state as a generator's inputs: values within ranges, and reports of what does not fit. */
import assert from 'node:assert/strict';
import { test } from 'node:test';
import type { Camera, GaussianSplatError } from '@gaussian-splat/core';
import type { Contract } from '@gaussian-splat/core/contract';
import type { GeneratorModel, GeneratorState } from '@gaussian-splat/generator';
import { type DynamicState, StateReader } from '../support/element/parts.js';

const CAMERA = {} as Camera;
const STATE: DynamicState = { timeSeconds: 0, pose: undefined, controls: {}, images: {} };

/** Reads states for models with these inputs. */
function readerOf(...models: Contract['inputs'][]): {
  read: (state: Partial<DynamicState>) => GeneratorState;
  messages: string[];
} {
  const reported: string[] = [];
  const reader = new StateReader(
    models.map((inputs) => ({ contract: { inputs } }) as unknown as GeneratorModel),
    ({ message }: GaussianSplatError) => reported.push(message),
  );
  const read = (some: Partial<DynamicState>): GeneratorState => {
    const state = { ...STATE, ...some };
    reader.checkPose(state);
    return reader.read(state, CAMERA, {}, []);
  };
  return { read, messages: reported };
}

const control = (min: number, max: number): Contract['inputs'][string] => ({
  role: 'control',
  range: [min, max],
  default: min,
});

test('a control that two models of a chain name the same stays within the ranges of both', () => {
  const { read, messages: reported } = readerOf({ Amount: control(-2, 1) }, { Amount: control(-1, 5) });
  assert.deepEqual(
    [0.5, 3, -3].map((amount) => read({ controls: { amount: [amount] } }).controls),
    [{ Amount: 0.5 }, { Amount: 1 }, { Amount: -1 }],
  );
  assert.equal(reported.length, 2);
  assert.match(reported[0], /expected -1 to 1, found 3/);
});

test('a control that is a tensor of Gaussians in the next model can still be set', () => {
  const { read, messages: reported } = readerOf(
    { scales: control(0, 9) },
    { scales: { role: 'gaussians', attribute: 'scales', scaleActivation: 'log' } },
  );
  assert.deepEqual([read({ controls: { scales: [4] } }).controls, reported], [{ scales: 4 }, []]);
});

test('a text for a control is reported as it was written, capital letters of the input or not', () => {
  const { read, messages: reported } = readerOf({ Amount: control(0, 1) });
  assert.deepEqual(read({ images: { amount: 'much' } }).controls, {});
  assert.equal(reported.length, 1);
  assert.match(reported[0], /control Amount: expected numbers, found much/);
});

test('a pose is reported if no model takes one, once', () => {
  const { read, messages: reported } = readerOf({ amount: control(0, 1) });
  for (let i = 0; i < 2; i++) read({ pose: [1, 2, 3] });
  assert.equal(reported.length, 1);
  assert.match(reported[0], /^pose: expected none/);
  const posed = readerOf({ amount: control(0, 1) }, { body: { role: 'pose', format: 'axis-angle' } });
  assert.deepEqual(posed.read({ pose: [1, 2, 3] }).pose, [1, 2, 3]);
  assert.deepEqual(posed.messages, []);
});

test('a seed is set like a control: a whole number of 32 bits, or the nearest', () => {
  const { read, messages: reported } = readerOf({ Noise: { role: 'seed' }, amount: control(0, 1) });
  assert.equal(read({}).seed, undefined);
  assert.deepEqual(
    [7, -1, 2.6, 1e12].map((seed) => read({ controls: { noise: [seed] } }).seed),
    [7, -1, 3, 2 ** 31 - 1],
  );
  assert.equal(reported.length, 2);
  assert.match(reported[0], /control Noise: expected a whole number from -2147483648 to 2147483647, found 2\.6/);
  assert.match(reported[1], /found 1000000000000/);
  assert.equal(read({ images: { noise: 'much' } }).seed, undefined);
  assert.match(reported[2], /control Noise: expected numbers, found much/);
});
