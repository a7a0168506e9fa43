import { dot, type Vector3 } from '../vector.js';

/** Rows of the rotation from scene coordinates to viewer space, whose y points up. */
export type ViewerFrame = readonly [Vector3, Vector3, Vector3];

/**
 * Returns the rotation of a unit vector to +y that changes the horizontal axes as little as possible. It is the
 * shortest rotation to +y or to -y, whichever is nearer; the latter is followed by diag(1, -1, -1). For -y, the
 * convention of the trainers, the result is diag(1, -1, -1).
 */
export function viewerFrame([x, y, z]: Vector3): ViewerFrame {
  const side = y < 0 ? -1 : 1;
  const share = 1 / (1 + side * y);
  const both = share * x * z;
  return [
    [1 - share * x * x, 0 - side * x, 0 - both],
    [x, y, z],
    [0 - side * both, 0 - z, side * (1 - share * z * z)],
  ];
}

/** Converts a direction or point from scene coordinates to viewer space. */
export const toViewer = (frame: ViewerFrame, v: Vector3): Vector3 => [
  dot(frame[0], v),
  dot(frame[1], v),
  dot(frame[2], v),
];

/** Converts a direction or point from viewer space to scene coordinates. The inverse of a rotation is its transpose. */
export const toScene = (frame: ViewerFrame, v: Vector3): Vector3 => [
  frame[0][0] * v[0] + frame[1][0] * v[1] + frame[2][0] * v[2],
  frame[0][1] * v[0] + frame[1][1] * v[1] + frame[2][1] * v[2],
  frame[0][2] * v[0] + frame[1][2] * v[1] + frame[2][2] * v[2],
];
