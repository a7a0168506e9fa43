// Moments of the basis functions of a splat's colour over the views: the lower triangle of a symmetric matrix, rows outermost. In memory each number has a row
// with one for every splat of the part.
#import shared/sh

const MAX_COEFFICIENTS = 16u;

var<private> matrix: array<f32, 136>;

fn at(row: u32, column: u32) -> u32 {
  return row * (row + 1u) / 2u + column;
}
