/** Labels beside points, so that as few as possible cover one another. */

/** Width of a letter in heights of the font, on average. */
const LETTER = 0.56;
const RADIUS = 7;

/** Where a label may stand, as directions from its point; the nearer ones first. */
const DIRECTIONS = [
  [1, 0],
  [-1, 0],
  [1, -1],
  [1, 1],
  [-1, -1],
  [-1, 1],
  [0, -1],
  [0, 1],
];
const DISTANCES = [1, 2.2, 3.6, 5.2, 7];

/**
 * @param points {{x: number, y: number, text: string, weight: number}[]} in pixels; heavier ones choose first.
 * @returns for each point {text, at, anchor, point, far}: `far` labels want a line to their point.
 */
export function placeLabels(points, { left, right, top, bottom, font }) {
  const taken = points.map(({ x, y }) => ({ x: x - 5, y: y - 5, width: 10, height: 10 }));
  const fits = (box) => box.x >= left && box.x + box.width <= right && box.y >= top && box.y + box.height <= bottom;
  const order = [...points].sort((a, b) => b.weight - a.weight || a.y - b.y);
  const placed = order.map((point) => {
    const candidates = DISTANCES.flatMap((distance) =>
      DIRECTIONS.map(([dx, dy]) => candidate(point, dx, dy, distance, font)),
    ).filter(({ box }) => fits(box));
    const cost = ({ box, distance }) => 100 * taken.reduce((sum, other) => sum + overlap(box, other), 0) + distance;
    const [best] = candidates.sort((a, b) => cost(a) - cost(b));
    if (best === undefined) return undefined;
    taken.push(best.box);
    return best;
  });
  return placed.filter(Boolean);
}

function candidate(point, dx, dy, distance, font) {
  const width = LETTER * font * point.text.length;
  const reach = RADIUS * distance;
  const x = point.x + dx * (dy === 0 ? reach : reach * 0.8);
  const y = point.y + dy * (reach + font / 3) + font / 3;
  const anchor = dx > 0 ? 'start' : dx < 0 ? 'end' : 'middle';
  const from = dx > 0 ? x : dx < 0 ? x - width : x - width / 2;
  const box = { x: from, y: y - 0.85 * font, width, height: 1.1 * font };
  return { text: point.text, at: { x, y }, anchor, point, far: distance > 2, box, distance };
}

function overlap(a, b) {
  const across = Math.min(a.x + a.width, b.x + b.width) - Math.max(a.x, b.x);
  const down = Math.min(a.y + a.height, b.y + b.height) - Math.max(a.y, b.y);
  return across > 0 && down > 0 ? across * down : 0;
}
