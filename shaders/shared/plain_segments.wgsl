// Segments without a depth.
#import shared/segments
#import shared/single

fn keep_depth(depth: Column) {}
fn kept_depth() -> Column { return Column(0.0); }
