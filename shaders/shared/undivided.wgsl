// Lists of tiles are not divided.
fn count_splats(first: u32, end: u32, lane: u32, word: u32, mask: u32) {}
fn divide_lists(lane: u32) {}
