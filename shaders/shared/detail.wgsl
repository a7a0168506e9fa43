// Levels of detail: a chunk stands for up to four finer ones, less truly by an error in world units. Of a chunk, the chunk that
// stands for it, and so on, exactly one is drawn, or two that fade into one another: each can tell for itself from its own error on
// screen and that of the chunk above, because both grow all the way up.
#import shared/view
#import shared/falloff

struct ChunkDetail {
  // Centre and radius: holds the spheres of all that the chunk stands for.
  sphere: vec4f,
  // That of the chunk above.
  parent_sphere: vec4f,
  // World units: the full error times the share, 0 to 1, in which what is finer has arrived; 0 where nothing finer is there to be drawn.
  error: f32,
  parent_error: f32,
  // The error, whether something finer is there or not.
  full_error: f32,
  // In the lower 24 bits the number of the streamed page that holds what the chunk stands for; in the upper 8 the share, in 255ths, in which
  // the page that the chunk is part of has arrived.
  children: u32,
}

// No such page, and the chunk has arrived.
const NO_CHILDREN = 4294967295u;
const CHILD_PAGE_BITS = 24u;
const CHILD_PAGE_MASK = 16777215u;
// Pixels that count as none: the logarithm of less would leave float32.
const SMALLEST_ERROR = 1e-30;

// Pixels that an error takes on screen at most, in the middle of the image. Does not depend on where the camera looks, so that a turn
// changes nothing.
fn screen_error(view: View, sphere: vec4f, error: f32) -> f32 {
  let away = max(length(sphere.xyz - view.eye) - sphere.w, view.near / view.stretch);
  let distance = select(away, 1.0 / view.stretch, view.is_orthographic != 0u);
  return max(view.focal.x, view.focal.y) * error / distance;
}

// Shares are counted in whole steps, for sums and differences of floats depend on how a compiler rounds, fuses and divides: so many of a fade,
// times so many of a page that arrives. All of them together are less than 2^24, which float32 holds exactly.
const FADE_STEPS = 65536u;
const ARRIVAL_STEPS = 255u;
const ALL_STEPS = FADE_STEPS * ARRIVAL_STEPS;

fn nearest_step(share: f32, steps: u32) -> u32 { return u32(clamp(share, 0.0, 1.0) * f32(steps) + 0.5); }

// Steps of a fade in which what is off by so many pixels has given way to what is finer.
fn refined(pixels: f32, allowed: f32, fade: f32) -> u32 {
  if (pixels > allowed) { return FADE_STEPS; }
  if (fade <= 0.0 || pixels < SMALLEST_ERROR) { return 0u; }
  return nearest_step(1.0 + log2(pixels / allowed) / fade, FADE_STEPS);
}

// Steps in which what a chunk stands for has arrived. The quotient of equal numbers need not be 1, but is nearest to it.
fn arrived_below(d: ChunkDetail) -> u32 {
  if (d.full_error <= 0.0) { return 0u; }
  return nearest_step(d.error / d.full_error, ARRIVAL_STEPS);
}

// The same for the chunk itself.
fn arrived(d: ChunkDetail) -> u32 { return d.children >> CHILD_PAGE_BITS; }

// Share, 0 to 1, in which a chunk is drawn: the steps in which the one above has given way, less those in which it has itself. What a chunk finds for
// the one above must be what that one finds for itself: then the shares of a chunk, the one above, and so on add up to 1, for what is below has
// never arrived further than what is above. So both go through the same instructions, a loop whose end no compiler knows. One that copied the body
// and rounded the copies differently would be off by a step where levels fade, and by nothing where they do not (decision 13).
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

// Opacity of a splat that is drawn to a share: what all shares together let through is the (weighted geometric) mean of what each would.
fn shared_opacity(opacity: f32, share: f32) -> f32 {
  if (share >= 1.0) { return opacity; }
  let capped = min(opacity, ALPHA_MAX);
  let excess = opacity / max(capped, 1e-30);
  return (1.0 - pow(1.0 - capped, share)) * pow(excess, share);
}
