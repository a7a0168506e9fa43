// For pictures of splats alone.
fn load_depth(k: u32, slot: u32) {}
fn start_pixel(pixel: vec2u) {}
fn is_hidden(k: u32) -> bool { return false; }
