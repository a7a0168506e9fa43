// The pixels of a thread: four, one above the other. A workgroup rasterizes SIDE · SIDE = 256 · COLUMN pixels at most: a
// tile, or a square of four small tiles. Only 64 threads have pixels of a single small tile.
const SIDE: u32 = TILE;
const COLUMN: u32 = 4u;
alias Column = vec4f;
alias Flags = vec4<bool>;
const STEPS = Column(0.0, 1.0, 2.0, 3.0);
fn largest(column: Column) -> f32 { return max(max(column.x, column.y), max(column.z, column.w)); }
fn row_of(column: Column, row: u32) -> f32 { return column[row]; }
fn with_row(column: Column, row: u32, value: f32) -> Column {
  var changed = column;
  changed[row] = value;
  return changed;
}
