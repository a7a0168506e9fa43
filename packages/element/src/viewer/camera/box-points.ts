/** Converts points of the page to coordinates of a box, including one that CSS has transformed. */
import type { Point } from './gestures.js';

/**
 * Converts a point of the page, CSS pixels as in a MouseEvent, to fractions of a box's width and height from its upper
 * left corner. NaN if the box is seen edge-on.
 */
export type BoxPoints = (clientX: number, clientY: number) => Point;

/** Corners of a box in circular order: left and top in percent of the box. */
const CORNERS = [
  [0, 0],
  [100, 0],
  [100, 100],
  [0, 100],
];

/**
 * Measures a box under any `transform`, `perspective` and `zoom`. Browsers provide only the bounding rectangle of a
 * transformed box. That of a box without extent is an exact position, so this function places such a box in each
 * corner. The projective map is that of Heckbert, "Fundamentals of Texture Mapping and Image Warping" (1989), section
 * 2.2.3.
 * @param box A positioned element.
 */
export function boxPoints(box: HTMLElement): BoxPoints {
  const [p, q, r, s] = cornersOf(box);
  const [ax, ay, bx, by] = [q.x - r.x, q.y - r.y, s.x - r.x, s.y - r.y];
  const [cx, cy] = [p.x - q.x + r.x - s.x, p.y - q.y + r.y - s.y];
  const area = ax * by - ay * bx;
  // Perspective: the divisor of the projection is 1 + g u + h v.
  const [g, h] = [(cx * by - cy * bx) / area, (ax * cy - ay * cx) / area];
  const alongU = { x: q.x - p.x + g * q.x, y: q.y - p.y + g * q.y };
  const alongV = { x: s.x - p.x + h * s.x, y: s.y - p.y + h * s.y };
  return (x, y) => {
    const [ux, uy] = [alongU.x - g * x, alongU.y - g * y];
    const [vx, vy] = [alongV.x - h * x, alongV.y - h * y];
    const [dx, dy] = [x - p.x, y - p.y];
    const determinant = ux * vy - uy * vx;
    return { x: (dx * vy - dy * vx) / determinant, y: (ux * dy - uy * dx) / determinant };
  };
}

/**
 * Returns a function that converts movements on the page near a point, CSS pixels, to CSS pixels of the box itself.
 * Movements stay unchanged if the box cannot be measured.
 */
export function boxMoves(box: HTMLElement, { x, y }: Point): (point: Point) => Point {
  const at = boxPoints(box);
  const [origin, right, below] = [at(x, y), at(x + 1, y), at(x, y + 1)];
  const { clientWidth: width, clientHeight: height } = box;
  const [rightX, rightY] = [width * (right.x - origin.x), height * (right.y - origin.y)];
  const [belowX, belowY] = [width * (below.x - origin.x), height * (below.y - origin.y)];
  if (![rightX, rightY, belowX, belowY].every(Number.isFinite)) return (point) => point;
  return (point) => ({ x: rightX * point.x + belowX * point.y, y: rightY * point.x + belowY * point.y });
}

function cornersOf(box: HTMLElement): Point[] {
  const marks = CORNERS.map(([left, top]) => {
    const mark = box.ownerDocument.createElement('i');
    mark.style.cssText = `position:absolute;left:${left}%;top:${top}%`;
    return mark;
  });
  box.append(...marks);
  const corners = marks.map((mark) => mark.getBoundingClientRect());
  for (const mark of marks) mark.remove();
  return corners.map(({ x, y }) => ({ x, y }));
}
