// Single rows of a column, for auxiliary outputs and depth.
#import shared/column

fn largest(column: Column) -> f32 { return max(max(column.x, column.y), max(column.z, column.w)); }
fn row_of(column: Column, row: u32) -> f32 { return column[row]; }
fn with_row(column: Column, row: u32, value: f32) -> Column {
  var changed = column;
  changed[row] = value;
  return changed;
}
