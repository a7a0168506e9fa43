// In place of shared/column_rows: the only row.
#import shared/single

fn largest(column: Column) -> f32 { return column; }
fn row_of(column: Column, row: u32) -> f32 { return column; }
fn with_row(column: Column, row: u32, value: f32) -> Column { return value; }
