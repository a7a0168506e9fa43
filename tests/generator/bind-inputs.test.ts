/** Roles to values: each checked against its meaning, by projecting points, not against the code's own matrices. */
import assert from 'node:assert/strict';
import { test } from 'node:test';
import { eyeOf, GaussianSplatError, lookAt, type Camera, type Vector3 } from '@gaussian-splat/core';
import type { CameraAxes, Contract, InputBinding } from '@gaussian-splat/core/contract';
import type { OnnxTensor } from '@gaussian-splat/core/onnx';
import { bindInputs, sameInputs, type GeneratorState, type InputNumbers } from '@gaussian-splat/generator';
import { headerWith, PACKED, tensor } from '../contract/support.js';
import { seededRandom } from '../support/random.js';

const camera: Camera = {
  width: 640,
  height: 400,
  fx: 510,
  fy: 490,
  cx: 300,
  cy: 210,
  worldToCamera: lookAt([1, -2, -4], [0.2, 0.1, 0], [0, -1, 0]),
  near: 0.5,
  far: 50,
};

function bind(
  binding: InputBinding,
  dims: OnnxTensor['dims'],
  state: GeneratorState = {},
  { dtype = 'float32', facts = {} }: { dtype?: OnnxTensor['dtype']; facts?: Partial<Contract> } = {},
): InputNumbers {
  const header = headerWith([tensor('x', dims, dtype)], [tensor('gaussians', [1, 13])]);
  return bindInputs(header, { ...PACKED, ...facts, inputs: { x: binding } }, state).x;
}

const numbers = ({ data }: InputNumbers): number[] => Array.from(data as ArrayLike<number | bigint>, Number);
const assertClose = (found: ArrayLike<number>, expected: ArrayLike<number>, tolerance = 2e-5): void => {
  assert.equal(found.length, expected.length);
  for (let i = 0; i < found.length; i++) {
    const error = Math.abs(found[i] - expected[i]);
    assert.ok(error <= tolerance * Math.max(1, Math.abs(expected[i])), `[${i}] ${found[i]} instead of ${expected[i]}`);
  }
};

/** A row-major matrix times a point, without dividing. */
const apply = (m: ArrayLike<number>, [x, y, z]: readonly number[]): number[] =>
  [0, 1, 2, 3].map((row) => m[4 * row] * x + m[4 * row + 1] * y + m[4 * row + 2] * z + m[4 * row + 3]);
const transposed = (m: readonly number[]): number[] => m.map((_, i) => m[4 * (i % 4) + Math.floor(i / 4)]);

const random = seededRandom(3);
const points = Array.from({ length: 50 }, (): Vector3 => [
  random.uniform(-2, 2),
  random.uniform(-2, 2),
  random.uniform(-2, 2),
]);
const ALL_AXES: readonly CameraAxes[] = ['RDF', 'RDB', 'RUF', 'RUB', 'LDF', 'LDB', 'LUF', 'LUB'];

test('view: the point in camera space, along the axes that are declared', () => {
  for (const axes of ALL_AXES) {
    const view = numbers(bind({ role: 'view', axes }, [4, 4], { camera }));
    for (const point of points) {
      const [right, down, forward] = apply(camera.worldToCamera, point);
      const expected = [
        axes.includes('R') ? right : -right,
        axes.includes('D') ? down : -down,
        axes.includes('F') ? forward : -forward,
      ];
      assertClose(apply(view, point), [...expected, 1]);
    }
  }
});

test('projection of view: the pixel that the intrinsics say, depth 0 at near and 1 at far, in every convention', () => {
  for (const axes of ALL_AXES) {
    const view = numbers(bind({ role: 'view', axes }, [4, 4], { camera }));
    const projection = numbers(bind({ role: 'projection', axes }, [4, 4], { camera }));
    for (const point of points) {
      const [x, y, z] = apply(camera.worldToCamera, point);
      const [clipX, clipY, clipZ, w] = apply(projection, apply(view, point));
      const pixel = [(clipX / w + 1) * 0.5 * camera.width, (1 - clipY / w) * 0.5 * camera.height];
      assertClose(pixel, [(camera.fx * x) / z + camera.cx, (camera.fy * y) / z + camera.cy], 1e-4);
      const { near, far } = camera;
      assertClose([clipZ / w, w], [(far * (z - near)) / ((far - near) * z), z], 1e-4);
    }
  }
  const projection = numbers(bind({ role: 'projection' }, [4, 4], { camera }));
  const depth = (z: number): number => {
    const clip = apply(projection, [0, 0, z]);
    return clip[2] / clip[3];
  };
  assertClose([depth(camera.near), depth(camera.far)], [0, 1]);
});

test('view_projection is their product; column-major is the transpose', () => {
  const view = numbers(bind({ role: 'view' }, [4, 4], { camera }));
  const projection = numbers(bind({ role: 'projection' }, [4, 4], { camera }));
  const both = numbers(bind({ role: 'view_projection' }, [4, 4], { camera }));
  for (const point of points) assertClose(apply(both, point), apply(projection, apply(view, point)), 1e-4);
  for (const role of ['view', 'projection', 'view_projection'] as const) {
    const rows = numbers(bind({ role, order: 'row-major' }, [4, 4], { camera }));
    assert.deepEqual(numbers(bind({ role, order: 'column-major' }, [4, 4], { camera })), transposed(rows));
    assert.deepEqual(numbers(bind({ role }, [4, 4], { camera })), rows, 'row-major is the default');
  }
});

test('camera_position and viewport', () => {
  assertClose(numbers(bind({ role: 'camera_position' }, [3], { camera })), eyeOf(camera.worldToCamera));
  assertClose(numbers(bind({ role: 'camera_position' }, [3], { camera })), [1, -2, -4]);
  assert.deepEqual(numbers(bind({ role: 'viewport' }, [2], { camera })), [640, 400]);
});

test('frame: that which a time falls into, rounding aside, and at the end the last one', () => {
  const at = (timeSeconds: number, facts: Partial<Contract>): number =>
    numbers(bind({ role: 'frame' }, [1], { timeSeconds }, { dtype: 'int32', facts }))[0];
  for (const fps of [12, 24, 25, 29.97, 30, 50, 60]) {
    for (let frame = 0; frame < 2000; frame++) {
      assert.equal(at(frame / fps, { fps }), frame, `the beginning of frame ${frame} at ${fps}`);
      assert.equal(at((frame + 0.999) / fps, { fps }), frame, `the end of frame ${frame} at ${fps}`);
      assert.equal(at((frame + 1) / fps, { fps, duration: (frame + 1) / fps }), frame, `the last of ${frame + 1}`);
    }
  }
  assert.deepEqual(
    [at(9, { fps: 4, duration: 1 }), at(1, { fps: 3, duration: 0.9 }), at(-1, { fps: 4 })],
    [3, 2, 0],
    'beyond the ends',
  );
  assert.deepEqual([at(9, {}), at(9, { duration: 10 })], [0, 0], 'without fps');
});

test('time, frame, seed', () => {
  const at = (seconds: number): GeneratorState => ({ timeSeconds: seconds });
  assert.deepEqual(bind({ role: 'time', unit: 'seconds' }, [1], at(1.5)), {
    dtype: 'float32',
    dims: [1],
    data: Float32Array.of(1.5),
  });
  const facts = { duration: 4, fps: 30 };
  assert.deepEqual(numbers(bind({ role: 'time', unit: 'normalized' }, [], at(1), { facts })), [0.25]);
  assert.deepEqual(bind({ role: 'time', unit: 'seconds' }, [], {}).dims, []);
  const frame = (state: GeneratorState): InputNumbers => bind({ role: 'frame' }, [1], state, { dtype: 'int64', facts });
  assert.deepEqual(frame(at(1.99)).data, BigInt64Array.of(59n));
  assert.deepEqual(frame({ frame: 7, timeSeconds: 3 }).data, BigInt64Array.of(7n));
  assert.deepEqual(bind({ role: 'seed' }, [1], { seed: 9 }, { dtype: 'int32' }).data, Int32Array.of(9));
});

test('poses, shapes and controls: set, or the default of the contract, or at rest', () => {
  const quaternion = { role: 'pose', format: 'quaternion' } as const;
  assert.deepEqual(numbers(bind({ ...quaternion, quaternionOrder: 'wxyz' }, [2, 4])), [1, 0, 0, 0, 1, 0, 0, 0]);
  assert.deepEqual(numbers(bind({ ...quaternion, quaternionOrder: 'xyzw' }, [2, 4])), [0, 0, 0, 1, 0, 0, 0, 1]);
  const angles: InputBinding = { role: 'pose', format: 'axis-angle' };
  assert.deepEqual(numbers(bind(angles, [1, 3])), [0, 0, 0]);
  assert.deepEqual(numbers(bind({ ...angles, default: [1, 2, 3] }, [1, 3])), [1, 2, 3]);
  assert.deepEqual(numbers(bind(angles, [1, 3], { pose: [4, 5, 6] })), [4, 5, 6]);
  assert.deepEqual(numbers(bind({ role: 'shape' }, [2])), [0, 0]);
  assert.deepEqual(numbers(bind({ role: 'shape' }, [2], { shape: Float32Array.of(1, 2) })), [1, 2]);
  const control: InputBinding = { role: 'control', range: [0, 9], default: 3 };
  assert.deepEqual(bind(control, [2, 2]).data, Float32Array.of(3, 3, 3, 3));
  assert.deepEqual(numbers(bind({ ...control, default: [1, 2] }, [2])), [1, 2]);
  assert.deepEqual(numbers(bind(control, [2], { controls: { x: 5 } })), [5, 5]);
  assert.deepEqual(bind(control, [2], { controls: { x: [4.6, 5] } }, { dtype: 'int32' }).data, Int32Array.of(5, 5));
});

test('Gaussians and images come from elsewhere', () => {
  const header = headerWith([tensor('image', [1, 3, 8, 8])], [tensor('gaussians', [1, 13])]);
  assert.deepEqual(bindInputs(header, { ...PACKED, inputs: { image: { role: 'image' } } }, {}), {});
});

test('equal inputs are recognized: then nothing needs to run', () => {
  const header = headerWith([tensor('t', [1]), tensor('v', [4, 4])], [tensor('gaussians', [1, 13])]);
  const contract: Contract = { ...PACKED, inputs: { t: { role: 'time', unit: 'seconds' }, v: { role: 'view' } } };
  const at = (state: GeneratorState): Record<string, InputNumbers> =>
    bindInputs(header, contract, { camera, ...state });
  assert.equal(sameInputs(at({}), at({ timeSeconds: 0, seed: 5, controls: { other: 1 } })), true);
  assert.equal(sameInputs(at({}), at({ timeSeconds: 1e-6 })), false);
  // Inputs that the generator ignores do not count.
  assert.equal(sameInputs(at({}), at({ camera: { ...camera, fx: 1 } })), true);
  const worldToCamera = lookAt([1, -2, -4.001], [0.2, 0.1, 0], [0, -1, 0]);
  assert.equal(sameInputs(at({}), at({ camera: { ...camera, worldToCamera } })), false);
  const { v: view, ...time } = at({});
  assert.deepEqual([sameInputs(at({}), time), sameInputs(time, at({}))], [false, false]);
  assert.equal(sameInputs({ x: view }, { x: { ...view, dims: [16] } }), false);
});

test('a missing camera, a wrong length and NaN are named', () => {
  const refused = (action: () => unknown, message: RegExp): void =>
    assert.throws(action, (error: unknown) => {
      assert.ok(error instanceof GaussianSplatError && error.code === 'argument/value', String(error));
      assert.match(error.message, message);
      return true;
    });
  for (const role of ['view', 'projection', 'view_projection', 'camera_position', 'viewport'] as const) {
    refused(() => bind({ role }, [4, 4]), /input x .*a camera/);
  }
  const angles: InputBinding = { role: 'pose', format: 'axis-angle' };
  refused(() => bind(angles, [2, 3], { pose: [1, 2, 3] }), /6 numbers for float32 \[2, 3\], found 3/);
  refused(() => bind(angles, [1, 3], { pose: [1, NaN, 3] }), /finite numbers, found NaN/);
});

test('several poses and shapes: one list in the order of the inputs, or each by its name', () => {
  const header = headerWith(
    [tensor('neck', [1, 3]), tensor('betas', [2]), tensor('jaw', [3]), tensor('expression', [1])],
    [tensor('gaussians', [1, 13])],
  );
  const contract: Contract = {
    ...PACKED,
    inputs: {
      neck: { role: 'pose', format: 'axis-angle' },
      jaw: { role: 'pose', format: 'axis-angle', default: [0.1, 0, 0] },
      betas: { role: 'shape' },
      expression: { role: 'shape', default: [0.5] },
    },
  };
  const at = (state: GeneratorState): number[][] =>
    ['neck', 'jaw', 'betas', 'expression'].map((name) => numbers(bindInputs(header, contract, state)[name]));
  const float = (...list: number[]): number[] => Array.from(Float32Array.from(list));
  assert.deepEqual(at({}), [[0, 0, 0], float(0.1, 0, 0), [0, 0], [0.5]]);
  assert.deepEqual(at({ pose: [1, 2, 3, 4, 5, 6], shape: [7, 8, 9] }), [[1, 2, 3], [4, 5, 6], [7, 8], [9]]);
  assert.deepEqual(at({ controls: { jaw: [4, 5, 6], betas: 2 } }), [[0, 0, 0], [4, 5, 6], [2, 2], [0.5]]);
  assert.deepEqual(at({ pose: [1, 2, 3, 4, 5, 6], controls: { neck: [9, 9, 9] } })[0], [9, 9, 9]);
  assert.throws(() => at({ pose: [1, 2, 3] }), /neck, jaw.*6 numbers in all, found 3/);
});

test('a flat matrix holds the numbers of a square one', () => {
  for (const order of ['row-major', 'column-major'] as const) {
    const binding: InputBinding = { role: 'view', order, axes: 'LUF' };
    assert.deepEqual(numbers(bind(binding, [1, 16], { camera })), numbers(bind(binding, [4, 4], { camera })));
  }
});
