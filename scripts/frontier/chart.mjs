/** The chart of speed against accuracy as SVG: milliseconds on a logarithmic axis, dB upwards, the front as a line. */
import { scaleLinear, scaleLog } from 'd3-scale';
import { adapterName } from '../../demo/bench/run/environment.js';
import { nonDominated, pointsOf } from './front.mjs';
import { placeLabels } from './labels.mjs';

const WIDTH = 920;
const HEIGHT = 620;
const MARGIN = { left: 64, right: 24, top: 64, bottom: 96 };
const FONT = 12;

/** Tiers of accuracy and where they begin, in dB of the worst view. */
const TIERS = [
  ['reference', 75],
  ['exact on a display', 59],
  ['high', 50],
  ['balanced', 42],
  ['fast', 36],
];

const STYLE = `
  svg { --ink: #1d1b18; --quiet: #6b645b; --ground: #fffdf9; --line: #e2dcd2; --own: #b3541e; --peer: #1f6fb2; }
  @media (prefers-color-scheme: dark) {
    svg { --ink: #ece7df; --quiet: #a59d92; --ground: #14120f; --line: #3a332a; --own: #f0a35c; --peer: #7db8ea; }
  }
  svg { font: ${FONT}px system-ui, sans-serif; }
  text { fill: var(--ink); }
  .label { paint-order: stroke; stroke: var(--ground); stroke-width: 3px; stroke-linejoin: round; }
  .quiet { fill: var(--quiet); }
  .grid { stroke: var(--line); }
  .own { fill: var(--own); } .peer { fill: var(--peer); }
  .wall { fill: var(--ground); stroke-width: 2; } .own.wall { stroke: var(--own); } .peer.wall { stroke: var(--peer); }
  .front { fill: none; stroke: var(--own); stroke-width: 1.5; stroke-dasharray: 5 4; }
  .leader { stroke: var(--quiet); stroke-width: 0.7; }`;

const escape = (text) =>
  String(text).replace(/[&<>"]/g, (c) => ({ '&': '&amp;', '<': '&lt;', '>': '&gt;', '"': '&quot;' })[c]);
const tag = (name, attributes, content = '') => {
  const text = Object.entries(attributes).map(
    ([key, value]) => ` ${key}="${escape(typeof value === 'number' ? +value.toFixed(2) : value)}"`,
  );
  return content === '' ? `<${name}${text.join('')}/>` : `<${name}${text.join('')}>${content}</${name}>`;
};
const words = (x, y, content, attributes = {}) => tag('text', { x, y, ...attributes }, escape(content));

/** @param report of the frontier page. */
export function drawChart(report) {
  const points = pointsOf(report);
  if (points.length === 0) throw new RangeError('a chart needs at least one configuration that worked');
  const scales = makeScales(points);
  const front = nonDominated(points);
  const parts = [
    tag('style', {}, STYLE),
    tag('rect', { width: WIDTH, height: HEIGHT, fill: 'var(--ground)' }),
    drawTitle(report),
    drawAxes(scales),
    drawFront(front, scales),
    drawPoints(points, front, scales),
    drawCaption(report),
  ];
  const title = tag('title', {}, 'Speed against accuracy of Gaussian splat renderers');
  const box = { xmlns: 'http://www.w3.org/2000/svg', viewBox: `0 0 ${WIDTH} ${HEIGHT}`, role: 'img' };
  return `${tag('svg', box, `${title}\n${parts.join('\n')}\n`)}\n`;
}

function makeScales(points) {
  const times = points.map(({ ms }) => ms);
  const accuracies = points.map(({ psnr }) => psnr);
  const x = scaleLog([Math.min(...times) / 1.35, Math.max(...times) * 1.5], [MARGIN.left, WIDTH - MARGIN.right]);
  const low = Math.min(34, Math.floor(Math.min(...accuracies) / 5) * 5 - 1);
  const y = scaleLinear([low, Math.max(...accuracies, 60) + 4], [HEIGHT - MARGIN.bottom, MARGIN.top]);
  return { x, y };
}

function drawTitle({ environment, scene }) {
  return [
    words(MARGIN.left, 26, 'Time of a frame against accuracy of its image', { 'font-size': 18, 'font-weight': 600 }),
    words(
      MARGIN.left,
      46,
      `${adapterName(environment.adapter)}, ${scene.width}×${scene.height}, ${scene.splats.toLocaleString('en')} splats. Left is faster, up is truer.`,
      { class: 'quiet' },
    ),
  ].join('\n');
}

function drawAxes({ x, y }) {
  const [left, right] = x.range();
  const [bottom, top] = y.range();
  const [low, high] = y.domain();
  const marks = x
    .ticks()
    .filter((ms) =>
      ['1', '2', '5'].includes(String(ms.toPrecision(1))[0] === '0' ? ms.toExponential()[0] : String(ms)[0]),
    );
  const columns = marks.flatMap((ms) => [
    tag('line', { class: 'grid', x1: x(ms), x2: x(ms), y1: top, y2: bottom }),
    words(x(ms), bottom + 18, ms, { 'text-anchor': 'middle', class: 'quiet' }),
  ]);
  const rows = y
    .ticks(8)
    .flatMap((dB) => [
      words(left - 8, y(dB) + 4, dB, { 'text-anchor': 'end', class: 'quiet' }),
      tag('line', { class: 'grid', x1: left - 4, x2: left, y1: y(dB), y2: y(dB) }),
    ]);
  const tiers = TIERS.filter(([, dB]) => dB > low && dB < high).flatMap(([name, dB]) => [
    tag('line', { class: 'grid', x1: left, x2: right, y1: y(dB), y2: y(dB) }),
    words(right, y(dB) - 4, `${name}: ${dB} dB`, { 'text-anchor': 'end', class: 'quiet', 'font-size': 11 }),
  ]);
  const titles = [
    words((left + right) / 2, bottom + 38, 'milliseconds a frame, median (logarithmic)', { 'text-anchor': 'middle' }),
    words(0, 0, 'PSNR of the worst view, dB', {
      'text-anchor': 'middle',
      transform: `translate(18 ${(top + bottom) / 2}) rotate(-90)`,
    }),
  ];
  return [...columns, ...rows, ...tiers, ...titles].join('\n');
}

/** Steps, not slopes: between two configurations there is nothing to choose. */
function drawFront(front, { x, y }) {
  const path = front.map(({ ms, psnr }, i) => (i === 0 ? `M${x(ms)} ${y(psnr)}` : `H${x(ms)} V${y(psnr)}`)).join(' ');
  return tag('path', { class: 'front', d: path.replace(/\d+\.\d+/g, (n) => Number(n).toFixed(1)) });
}

function drawPoints(points, front, { x, y }) {
  const placed = placeLabels(
    points.map((point) => ({
      x: x(point.ms),
      y: y(point.psnr),
      text: point.name,
      weight: front.includes(point) ? 1 : 0,
    })),
    { left: MARGIN.left, right: WIDTH - MARGIN.right, top: MARGIN.top, bottom: HEIGHT - MARGIN.bottom, font: FONT },
  );
  const marks = points.map((point) => {
    const kind = `${point.peer ? 'peer' : 'own'}${point.clock === 'wall' ? ' wall' : ''}`;
    const note = `${point.name}: ${point.ms.toFixed(2)} ms (${point.clock}), ${point.psnr.toFixed(1)} dB, worst pixel ${point.worst.toFixed(1)}/255, SSIM ${point.ssim.toFixed(4)}`;
    return tag('circle', { class: kind, cx: x(point.ms), cy: y(point.psnr), r: 5 }, tag('title', {}, escape(note)));
  });
  const labels = placed.map(({ text, at, anchor, point, far }) => {
    const line = far ? tag('line', { class: 'leader', x1: point.x, y1: point.y, x2: at.x, y2: at.y - 4 }) : '';
    const weight = point.weight ? { 'font-weight': 600 } : {};
    return line + words(at.x, at.y, text, { class: 'label', 'text-anchor': anchor, ...weight });
  });
  return [...marks, ...labels].join('\n');
}

function drawCaption({ environment, scene, reference, run, standard }) {
  const { versions, date, userAgent } = environment;
  const browser = /(?:Headless)?(?:Chrome|Firefox|Version)\/[\d.]+/.exec(userAgent)?.[0] ?? userAgent;
  const against = reference.kind === 'oracle' ? 'the float64 oracle' : 'our compute rasterizer in float32';
  const lines = [
    `Orange: ours (${versions.commit}); blue: PlayCanvas ${versions.playcanvas}, Spark ${versions.spark}. Filled: GPU time, first pass to last; hollow: wall time, queue drained.`,
    `Dashed, bold: nothing else is both faster and truer. ${scene.views} views of the path “${scene.path}”, covered pixels, against ${against}.`,
    `Scene ${scene.scene.split('/').at(-1)}, ${scene.antialiased ? 'antialiased' : 'classic'}; ${run.rounds} × ${run.frames} frames${standard ? ', each beside the default in turns' : ''}; ${browser}; ${date.slice(0, 10)}.`,
  ];
  return lines
    .map((line, i) => words(MARGIN.left - 40, HEIGHT - 40 + 15 * i, line, { class: 'quiet', 'font-size': 11 }))
    .join('\n');
}
