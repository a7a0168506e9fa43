/** Small line charts as SVG that read on light and dark pages. */
import { scaleLinear, scaleLog } from 'd3-scale';

const WIDTH = 560;
const HEIGHT = 300;
const SIDES = { top: 30, right: 16, bottom: 44, left: 54 };
/** Names of curves stand above the plot, a line each, away from the curves. */
const LINE = 13;
const COLORS = ['#2166ac', '#b2182b', '#1b7837', '#762a83'];
/** dB that stand for equal images. */
const MAX = 130;

const escape = (text) =>
  String(text).replace(/[&<>"]/g, (c) => ({ '&': '&amp;', '<': '&lt;', '>': '&gt;', '"': '&quot;' })[c]);

/**
 * @param curves {{name: string, points: [number, number][]}[]}
 * @param options.marks {{x: number, name: string}[]} vertical lines
 * @param options.line {{y: number, name: string}} a horizontal one
 */
export function lineChart(curves, { title, x: xTitle, y: yTitle, log = false, marks = [], line }) {
  const margin = { ...SIDES, top: SIDES.top + LINE * curves.length };
  const points = curves.flatMap((curve) => curve.points);
  const xs = points.map(([x]) => x);
  const ys = [...points.map(([, y]) => Math.min(MAX, y)), ...(line ? [line.y] : [])];
  const x = (log ? scaleLog() : scaleLinear())
    .domain([Math.min(...xs), Math.max(...xs)])
    .range([margin.left, WIDTH - margin.right]);
  const y = scaleLinear()
    .domain([Math.min(...ys) - 3, Math.max(...ys) + 3])
    .range([HEIGHT - margin.bottom, margin.top]);
  const text = (at, down, words, more = '') =>
    `<text x="${at.toFixed(1)}" y="${down.toFixed(1)}" ${more}>${escape(words)}</text>`;
  // A name that would exceed the chart on the right stands to the left of its line.
  const nameOf = (mark, i) => {
    const isLate = x(mark.x) > WIDTH / 2;
    const [at, anchor] = isLate ? [x(mark.x) - 4, 'end'] : [x(mark.x) + 4, 'start'];
    return text(at, HEIGHT - margin.bottom - 6 - LINE * i, mark.name, `text-anchor="${anchor}" fill="#666"`);
  };
  const parts = [
    `<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 ${WIDTH} ${HEIGHT}" width="${WIDTH}" height="${HEIGHT}" font-family="system-ui, sans-serif" font-size="11" role="img" aria-label="${escape(title)}">`,
    `<rect width="100%" height="100%" fill="#fff"/>`,
    text(margin.left, 16, title, 'font-size="13" font-weight="bold" fill="#111"'),
    ...y
      .ticks(6)
      .map(
        (tick) =>
          `<path d="M${margin.left} ${y(tick)}H${WIDTH - margin.right}" stroke="#ddd"/>${text(margin.left - 6, y(tick) + 4, tick, 'text-anchor="end" fill="#444"')}`,
      ),
    ...(log ? xs.filter((v, i) => xs.indexOf(v) === i) : x.ticks(8)).map((tick) =>
      text(x(tick), HEIGHT - margin.bottom + 16, shortNumber(tick), 'text-anchor="middle" fill="#444"'),
    ),
    text((margin.left + WIDTH - margin.right) / 2, HEIGHT - 8, xTitle, 'text-anchor="middle" fill="#111"'),
    text(0, 0, yTitle, `transform="translate(14 ${HEIGHT / 2}) rotate(-90)" text-anchor="middle" fill="#111"`),
    ...marks.map(
      (mark, i) =>
        `<path d="M${x(mark.x)} ${margin.top}V${HEIGHT - margin.bottom}" stroke="#999" stroke-dasharray="2 3"/>${nameOf(mark, i)}`,
    ),
    ...(line
      ? [
          `<path d="M${margin.left} ${y(line.y)}H${WIDTH - margin.right}" stroke="#111" stroke-dasharray="5 3"/>${text(WIDTH - margin.right, y(line.y) - 4, line.name, 'text-anchor="end" fill="#111"')}`,
        ]
      : []),
    ...curves.flatMap((curve, i) => {
      const color = COLORS[i % COLORS.length];
      const places = curve.points.map(([a, b]) => [x(a), y(Math.min(MAX, b))]);
      return [
        `<path d="M${places.map((p) => p.map((v) => v.toFixed(1)).join(' ')).join('L')}" fill="none" stroke="${color}" stroke-width="2"/>`,
        ...places.map(([a, b]) => `<circle cx="${a.toFixed(1)}" cy="${b.toFixed(1)}" r="3" fill="${color}"/>`),
        text(WIDTH - margin.right, SIDES.top + LINE * i, curve.name, `text-anchor="end" fill="${color}"`),
      ];
    }),
    '</svg>',
  ];
  return `${parts.join('\n')}\n`;
}

const shortNumber = (value) => (value >= 1e4 ? value.toExponential(0).replace('e+', 'e') : String(value));
