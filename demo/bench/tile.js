/** Scenes of any size from a small one: copies on a square grid on the ground plane. */

/** World units between copies: scenes of the demo have a radius of about 0.8. */
const STEP = 2;
const GEOMETRY_WORDS = 12;

/**
 * A packed scene repeated up to `count` splats (the scene alone for a smaller count), cells nearest the centre first.
 * @returns the packed scene, and the radius at which a camera overlooks it.
 */
export function tilePacked(packed, count) {
  if (count <= packed.count) return { packed, radius: 2.5 };
  const copies = Math.ceil(count / packed.count);
  const side = Math.ceil(Math.sqrt(copies));
  const cells = [];
  for (let i = 0; i < side * side; i++)
    cells.push([(i % side) - (side - 1) / 2, Math.floor(i / side) - (side - 1) / 2]);
  cells.sort((a, b) => Math.hypot(...a) - Math.hypot(...b));

  const shWords = packed.sh.length / packed.count;
  const geometry = new Uint32Array(GEOMETRY_WORDS * count);
  const sh = new Uint32Array(shWords * count);
  const floats = new Float32Array(geometry.buffer);
  for (let copy = 0; copy < copies; copy++) {
    const first = copy * packed.count;
    const length = Math.min(packed.count, count - first);
    geometry.set(packed.geometry.subarray(0, GEOMETRY_WORDS * length), GEOMETRY_WORDS * first);
    sh.set(packed.sh.subarray(0, shWords * length), shWords * first);
    for (let i = first; i < first + length; i++) {
      floats[GEOMETRY_WORDS * i] += cells[copy][0] * STEP;
      floats[GEOMETRY_WORDS * i + 2] += cells[copy][1] * STEP;
    }
  }
  return { packed: { ...packed, count, geometry, sh }, radius: 0.6 * side * STEP };
}
