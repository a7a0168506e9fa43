/** Labels beside points, so that as few as possible cover one another. */

/** Width of a letter in heights of the font, on average. */
const LETTER = 0.56;
const RADIUS = 7;

/** Points nearer than this in both directions are one to the eye. */
const SAME = 4;
/** Names that a label has room for. */
const MAX_NAMES = 3;

/** Directions of a label from its point, the nearest ones first. */
const DIRECTIONS = [
  [1, 0],
  [-1, 0],
  [1, -0.5],
  [1, 0.5],
  [1, -1],
  [1, 1],
  [-1, -1],
  [-1, 1],
  [0, -1],
  [0, 1],
];
const DISTANCES = [1, 2.2, 3.6, 5.2, 7, 9, 11.5, 14, 17];

const ROUNDS = 6;

/**
 * Cost of a label: covering a pixel of another, crossing another label or its line, a line over a point, and each step
 * away.
 */
const COVERED = 100;
const CROSSED = 400;
const TANGLED = 150;
const TOUCHED = 12;
const FAR = 8;

/**
 * @param points {{x: number, y: number, text: string, weight: number}[]} in pixels; heavier ones choose first.
 * @returns a label for each point, or one for points that lie on one another: {text, at, anchor, point, far}; `far` labels want a line to their point.
 */
export function placeLabels(points, { left, right, top, bottom, font }) {
  const dots = points.map(({ x, y }) => ({ x: x - 5, y: y - 5, width: 10, height: 10 }));
  const fits = (box) => box.x >= left && box.x + box.width <= right && box.y >= top && box.y + box.height <= bottom;
  const order = together(points).sort((a, b) => b.weight - a.weight || a.y - b.y);
  const choices = order.map((point) =>
    DISTANCES.flatMap((distance) => DIRECTIONS.map(([dx, dy]) => candidate(point, dx, dy, distance, font))).filter(
      ({ box }) => fits(box),
    ),
  );
  const labels = order.map(() => undefined);
  // Places each label at its lowest cost beside all others. A few rounds follow, since the first labels ignore the
  // later ones.
  for (let round = 0; round < ROUNDS; round++) {
    choices.forEach((candidates, i) => {
      const others = labels.filter((label, k) => label !== undefined && k !== i);
      const costs = candidates.map((label) => costOf(label, others, dots));
      labels[i] = candidates[costs.indexOf(Math.min(...costs))];
    });
  }
  return labels.filter(Boolean);
}

function costOf(label, others, dots) {
  const covered = [...dots, ...others.map(({ box }) => box)].reduce((sum, box) => sum + overlap(label.box, box), 0);
  const crossed = others.filter((other) => crosses(label, other.box) || crosses(other, label.box)).length;
  const touched = dots.filter((dot) => crosses(label, dot)).length;
  const tangled = others.filter((other) => label.far && other.far && meet(label, other)).length;
  return COVERED * covered + CROSSED * crossed + TANGLED * tangled + TOUCHED * touched + FAR * label.distance;
}

/** Points that lie on one another as one, named after all of them, the heaviest first. */
function together(points) {
  const groups = [];
  for (const point of [...points].sort((a, b) => b.weight - a.weight)) {
    const near = groups.find(([{ x, y }]) => Math.abs(x - point.x) < SAME && Math.abs(y - point.y) < SAME);
    if (near) near.push(point);
    else groups.push([point]);
  }
  return groups.map((group) => {
    const names = group.map(({ text }) => text);
    const more = names.length - MAX_NAMES;
    const text = more > 1 ? `${names.slice(0, MAX_NAMES).join(', ')} and ${more} more` : names.join(', ');
    return { ...group[0], text };
  });
}

function candidate(point, dx, dy, distance, font) {
  const width = LETTER * font * point.text.length * (point.weight ? 1.1 : 1);
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

/** Whether the line of a label runs through a box. */
function crosses({ point, at, far }, box) {
  if (!far) return false;
  return [0.1, 0.25, 0.4, 0.55, 0.7, 0.85].some((t) => {
    const x = point.x + t * (at.x - point.x);
    const y = point.y + t * (at.y - 4 - point.y);
    return x > box.x && x < box.x + box.width && y > box.y && y < box.y + box.height;
  });
}

/** Whether the lines of two labels cross. */
function meet(a, b) {
  const side = ({ point, at }, { x, y }) => (at.x - point.x) * (y - point.y) - (at.y - 4 - point.y) * (x - point.x);
  const end = ({ at }) => ({ x: at.x, y: at.y - 4 });
  return side(a, b.point) * side(a, end(b)) < 0 && side(b, a.point) * side(b, end(a)) < 0;
}
