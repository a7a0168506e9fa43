/** `node scripts/frontier/sizes.mjs`: the chart of the time of a frame by the size of its image, ours beside HiGS, from docs/frontier/sizes-*.json. */
import { readdirSync, readFileSync, writeFileSync } from 'node:fs';
import { join } from 'node:path';
import { scaleLog } from 'd3-scale';
import { styleOf, tag, words } from '../charts/svg.mjs';
import { root } from '../lib/run.mjs';

const FONT = 13;
const [WIDTH, HEIGHT] = [640, 380];
const MARGIN = { left: 52, right: 150, top: 56, bottom: 44 };
const MARKS = [0.2, 0.5, 1, 2];

function drawSizes({ adapter, date, sizes, lines }) {
  const times = lines.flatMap(({ milliseconds }) => milliseconds);
  const x = scaleLog([sizes[0][0], sizes.at(-1)[0]], [MARGIN.left, WIDTH - MARGIN.right]);
  const y = scaleLog([Math.min(...times) / 1.2, Math.max(...times) * 1.2], [HEIGHT - MARGIN.bottom, MARGIN.top]);
  const grid = MARKS.flatMap((ms) => [
    tag('line', { class: 'grid', x1: MARGIN.left, x2: WIDTH - MARGIN.right, y1: y(ms), y2: y(ms) }),
    words(MARGIN.left - 8, y(ms) + 4, ms, { 'text-anchor': 'end', class: 'quiet' }),
  ]);
  const columns = sizes.map(([width, height]) =>
    words(x(width), HEIGHT - MARGIN.bottom + 22, `${width} × ${height}`, { 'text-anchor': 'middle', class: 'quiet' }),
  );
  const drawn = lines.flatMap(({ splats, name, milliseconds }) => {
    const kind = name === 'ours' ? 'own' : 'peer';
    const points = milliseconds.map((ms, i) => [x(sizes[i][0]), y(ms)]);
    const path = points.map((point) => point.map((value) => value.toFixed(1)).join(',')).join(' ');
    return [
      tag('polyline', { points: path, fill: 'none', stroke: `var(--${kind})`, 'stroke-width': 2 }),
      ...points.map(([cx, cy]) => tag('circle', { class: kind, cx, cy, r: 4 })),
      words(points.at(-1)[0] + 10, points.at(-1)[1] + 4, `${name}, ${splats}`),
    ];
  });
  const parts = [
    tag('style', {}, styleOf({ font: FONT })),
    tag('rect', { width: WIDTH, height: HEIGHT, fill: 'var(--ground)' }),
    words(MARGIN.left, 26, 'Milliseconds a frame by the size of the image', { 'font-size': 16, 'font-weight': 600 }),
    words(MARGIN.left, 44, `${adapter}, ${date}`, { class: 'quiet' }),
    ...[...grid, ...columns, ...drawn],
  ];
  const box = { xmlns: 'http://www.w3.org/2000/svg', viewBox: `0 0 ${WIDTH} ${HEIGHT}`, role: 'img' };
  return `${tag('svg', box, `${tag('title', {}, 'Milliseconds a frame by the size of the image, ours and HiGS')}\n${parts.join('\n')}\n`)}\n`;
}

const folder = join(root, 'docs/frontier');
for (const name of readdirSync(folder).filter((file) => /^sizes-.*\.json$/.test(file))) {
  const figures = JSON.parse(readFileSync(join(folder, name), 'utf8'));
  writeFileSync(join(folder, name.replace('.json', '.svg')), drawSizes(figures));
}
