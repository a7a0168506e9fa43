// Levels of detail: a chunk replaces up to four finer ones with an error in world units. Along each path from a finest
// chunk to the root exactly one chunk is drawn, or two that cross-fade. Each chunk decides on its own, from its screen
// error and that of its parent, because both grow all the way up.
#import shared/view
#import shared/falloff

struct ChunkDetail {
  // Center and radius: encloses the spheres of all descendants.
  sphere: vec4f,
  // The same for the parent.
  parent_sphere: vec4f,
  // World units: `full_error` times the fade-in of the children, 0 to 1; 0 if no children are resident.
  error: f32,
  parent_error: f32,
  // The error in world units, whether or not children are resident.
  full_error: f32,
  // Lower 24 bits: index of the streamed page of the children. Upper 8 bits: fade-in of the page of the chunk itself,
  // in 255ths.
  children: u32,
}

// The chunk has no such page, and is fully faded in.
const NO_CHILDREN = 4294967295u;
const CHILD_PAGE_BITS = 24u;
const CHILD_PAGE_MASK = 16777215u;
// Errors in pixels below this count as none, because their logarithm would overflow float32.
const SMALLEST_ERROR = 1e-30;

// Upper bound of the pixels that an error covers at the center of the image. It does not depend on the camera's
// direction, so a rotation changes nothing.
fn screen_error(view: View, sphere: vec4f, error: f32) -> f32 {
  let away = max(length(sphere.xyz - view.eye) - sphere.w, view.near / view.stretch);
  let distance = select(away, 1.0 / view.stretch, view.is_orthographic != 0u);
  return max(view.focal.x, view.focal.y) * error / distance;
}

// Weights are counted in integer steps, because sums of floats depend on how a compiler rounds, fuses and divides:
// FADE_STEPS of a cross-fade times ARRIVAL_STEPS of a page's fade-in. Their product is below 2^24, which float32
// represents exactly.
const FADE_STEPS = 65536u;
const ARRIVAL_STEPS = 255u;
const ALL_STEPS = FADE_STEPS * ARRIVAL_STEPS;

fn nearest_step(share: f32, steps: u32) -> u32 { return u32(clamp(share, 0.0, 1.0) * f32(steps) + 0.5); }

// How many FADE_STEPS of a chunk with this screen error its children have replaced.
fn refined(pixels: f32, allowed: f32, fade: f32) -> u32 {
  if (pixels > allowed) { return FADE_STEPS; }
  if (fade <= 0.0 || pixels < SMALLEST_ERROR) { return 0u; }
  return nearest_step(1.0 + log2(pixels / allowed) / fade, FADE_STEPS);
}

// Fade-in of the children of a chunk, in ARRIVAL_STEPS. The quotient of equal numbers need not be 1, but it rounds to
// it.
fn arrived_below(d: ChunkDetail) -> u32 {
  if (d.full_error <= 0.0) { return 0u; }
  return nearest_step(d.error / d.full_error, ARRIVAL_STEPS);
}

// The same for the chunk itself.
fn arrived(d: ChunkDetail) -> u32 { return d.children >> CHILD_PAGE_BITS; }

// Weight, 0 to 1, of a chunk: the steps by which it has replaced its parent, minus those by which its children have
// replaced it. A chunk must compute the same value for its parent as the parent does; then the weights along a path add
// up to 1, because children never fade in further than their parent. So both run the same instructions, in a loop with
// a length unknown to compilers. A compiler that duplicated the body and rounded the copies differently would be off by
// one step during a fade, and by nothing otherwise (decision 13).
fn share_drawn(view: View, d: ChunkDetail, allowed: f32) -> f32 {
  var own = 0u;
  var steps = 0u;
  for (var side = 0u; side <= view.has_detail; side++) {
    let is_above = side > 0u;
    let pixels = screen_error(view, select(d.sphere, d.parent_sphere, is_above), select(d.full_error, d.parent_error, is_above));
    own = steps;
    steps = select(arrived_below(d), arrived(d), is_above) * refined(pixels, allowed, view.detail_fade);
  }
  let drawn = max(steps, own) - own;
  return select(f32(drawn) / f32(ALL_STEPS), 1.0, drawn == ALL_STEPS);
}

// Opacity of a splat drawn with a weight: the transmittance of all weighted levels together is their weighted geometric
// mean.
fn shared_opacity(opacity: f32, share: f32) -> f32 {
  if (share >= 1.0) { return opacity; }
  let capped = min(opacity, ALPHA_MAX);
  let excess = opacity / max(capped, 1e-30);
  return (1.0 - pow(1.0 - capped, share)) * pow(excess, share);
}
