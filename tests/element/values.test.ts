/** Values of poses and controls in the forms that trackers and authors have. */
import assert from 'node:assert/strict';
import { test } from 'node:test';
import { readControls, readNumbers, type Numbers } from '../support/element/parts.js';

test('landmarks, nested lists and texts of them are the same numbers', () => {
  const landmarks = [
    { x: 1, y: 2, z: 3, visibility: 0.9 },
    { x: 4, y: 5, z: 6, visibility: 0.1 },
  ];
  const forms: Numbers[] = [
    landmarks,
    JSON.stringify(landmarks),
    [
      [1, 2, 3],
      [4, 5, 6],
    ],
    Float32Array.of(1, 2, 3, 4, 5, 6),
    '1 2,3 4 5 6',
  ];
  for (const form of forms) assert.deepEqual(readNumbers(form), [1, 2, 3, 4, 5, 6]);
  assert.deepEqual(readNumbers({ x: 1, y: 2, z: 3 }), [1, 2, 3]);
});

test('a quaternion object has no known order, and a value that is no number is refused', () => {
  assert.equal(readNumbers([{ x: 0, y: 0, z: 0, w: 1 }] as unknown as Numbers), undefined);
  assert.equal(readNumbers([{ x: 0, y: '1', z: 0 }] as unknown as Numbers), undefined);
  assert.equal(readNumbers([NaN]), undefined);
});

test('landmarks of a control are numbers, not an image', () => {
  const warnings: string[] = [];
  const { controls, images } = readControls(
    [],
    { face: [{ x: 1, y: 2, z: 3 }], photo: {} as ImageBitmap },
    (sentence) => warnings.push(sentence),
  );
  assert.deepEqual([controls, Object.keys(images), warnings], [{ face: [1, 2, 3] }, ['photo'], []]);
});
