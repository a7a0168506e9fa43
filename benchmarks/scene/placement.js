/** Scenes of any size from a small one: where its copies stand. */

/** World units between copies: the scene that ships has a radius of about 0.8. */
const STEP = 2;
/** Radius from which a camera overlooks one copy, and each further ring of them. */
export const LONE_RADIUS = 2.5;
const RADIUS_PER_SIDE = 0.6;

/** Offsets on a square grid in the ground plane, nearest to its center first, so that copy 0 of odd sides stays in place. */
function grid(copies, height) {
  const side = Math.ceil(Math.sqrt(copies));
  const cells = Array.from({ length: side * side }, (_, i) => [
    ((i % side) - (side - 1) / 2) * STEP,
    height,
    (Math.floor(i / side) - (side - 1) / 2) * STEP,
  ]);
  return { side, cells: cells.sort((a, b) => Math.hypot(a[0], a[2]) - Math.hypot(b[0], b[2])).slice(0, copies) };
}

/**
 * Positions of copies of a scene of `base` splats that have `count` splats together (0: one copy).
 * `ground`: all on the ground plane; the more splats, the more of them in view.
 * `overhead`: the first `visible` splats on the ground, all others so high above it that only the path `zoom` shows
 * them. It measures the cost of splats outside the view.
 * @returns {{radius: number, copies: {offset: number[], length: number}[]}} the orbit's radius in world units, and for
 * each copy its offset in world units and its number of splats.
 */
export function placeCopies({ base, count, layout = 'ground', visible = count }) {
  if (count === 0) count = base;
  if (layout !== 'ground' && layout !== 'overhead') {
    throw new RangeError(`layout: expected ground or overhead, found "${layout}"`);
  }
  const onGround = layout === 'ground' ? count : Math.min(count, visible);
  const ground = layOut(base, onGround, 0);
  const radius = ground.side === 1 ? LONE_RADIUS : RADIUS_PER_SIDE * ground.side * STEP;
  const above = count - onGround;
  if (above === 0) return { radius, copies: ground.copies };
  // Seen from anywhere on a path, the lowest and farthest of them stands more than 45 degrees up.
  const extent = Math.ceil(Math.sqrt(Math.ceil(above / base))) * STEP;
  return { radius, copies: [...ground.copies, ...layOut(base, above, -(2 * radius + extent)).copies] };
}

function layOut(base, count, height) {
  const { side, cells } = grid(Math.ceil(count / base), height);
  const copies = cells.map((offset, i) => ({ offset, length: Math.min(base, count - i * base) }));
  return { side, copies };
}
