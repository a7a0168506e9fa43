// Moments of the color basis functions of a splat over the views: the lower triangle of a symmetric matrix, row-major.
// In memory each entry has a row with one number for every splat of the block.
#import shared/sh

const MAX_COEFFICIENTS = 16u;

var<private> matrix: array<f32, 136>;

fn at(row: u32, column: u32) -> u32 {
  return row * (row + 1u) / 2u + column;
}
