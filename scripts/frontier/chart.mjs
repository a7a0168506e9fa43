/** The chart of speed against accuracy as SVG: milliseconds on a logarithmic axis, dB upwards, the front as a line. */
import { scaleLinear, scaleLog } from 'd3-scale';
import { adapterName } from '../../benchmarks/run/environment.js';
import { nonDominated, pointsOf, perceptual } from './front.mjs';
import { placeLabels } from './labels.mjs';
import { escape, styleOf, tag, words } from '../charts/svg.mjs';

/** The whole chart, and one that can be read on a phone: there most settings are dots without a name. */
const LAYOUTS = {
  whole: { width: 920, height: 620, margin: { left: 64, right: 24, top: 64, bottom: 96 }, font: 12, isSmall: false },
  small: { width: 460, height: 470, margin: { left: 52, right: 10, top: 74, bottom: 92 }, font: 15, isSmall: true },
};
/** Configurations that the small chart names, besides the front. */
const NAMED_TIERS = ['tier', 'variant', 'peer'];

/** Tiers of accuracy and their lower limits, in dB PSNR of the worst view. */
const TIERS = [
  ['reference', 75],
  ['exact on a display', 59],
  ['high', 50],
  ['balanced', 42],
  ['fast', 36],
];

/**
 * @param report of the frontier page.
 * @param size {'whole' | 'small'}
 */
export function drawChart(report, size = 'whole') {
  const points = pointsOf(report);
  if (points.length === 0) throw new RangeError('a chart needs at least one configuration that worked');
  const layout = LAYOUTS[size];
  const { width, height } = layout;
  const scales = makeScales(points, layout);
  const front = nonDominated(points);
  const parts = [
    tag('style', {}, styleOf(layout)),
    tag('rect', { width, height, fill: 'var(--ground)' }),
    drawTitle(report, layout),
    drawAxes(scales, layout),
    drawFront(front, scales),
    drawPoints(points, front, scales, layout),
    drawCaption(report, layout),
  ];
  const title = tag('title', {}, 'Speed against accuracy of Gaussian splat renderers');
  const box = { xmlns: 'http://www.w3.org/2000/svg', viewBox: `0 0 ${width} ${height}`, role: 'img' };
  return `${tag('svg', box, `${title}\n${parts.join('\n')}\n`)}\n`;
}

function makeScales(points, { width, height, margin }) {
  const times = points.map(({ ms }) => ms);
  const accuracies = points.map(({ psnr }) => psnr);
  const x = scaleLog([Math.min(...times) / 1.35, Math.max(...times) * 1.5], [margin.left, width - margin.right]);
  const low = Math.min(34, Math.floor(Math.min(...accuracies) / 5) * 5 - 1);
  const y = scaleLinear([low, Math.max(...accuracies, 60) + 4], [height - margin.bottom, margin.top]);
  return { x, y };
}

function drawTitle({ environment, scene }, { margin, isSmall, font }) {
  const about = `${adapterName(environment.adapter)}, ${scene.width}×${scene.height}, ${scene.splats.toLocaleString('en')} splats`;
  const left = isSmall ? font : margin.left;
  const lines = isSmall
    ? [`${about}.`, 'Left is faster, up is more accurate.']
    : [`${about}. Left is faster, up is more accurate.`];
  return [
    words(left, 26, isSmall ? 'Time of a frame against accuracy' : 'Time of a frame against accuracy of its image', {
      'font-size': 1.15 * font + (isSmall ? 0 : 4),
      'font-weight': 600,
    }),
    ...lines.map((line, i) => words(left, 46 + 18 * i, line, { class: 'quiet' })),
  ].join('\n');
}

function drawAxes({ x, y }, { isSmall, font }) {
  const [left, right] = x.range();
  const [bottom, top] = y.range();
  const [low, high] = y.domain();
  const firsts = isSmall ? ['1'] : ['1', '2', '5'];
  const marks = x.ticks().filter((ms) => firsts.includes(ms.toExponential()[0]));
  const columns = marks.flatMap((ms) => [
    tag('line', { class: 'grid', x1: x(ms), x2: x(ms), y1: top, y2: bottom }),
    words(x(ms), bottom + 1.5 * font, ms, { 'text-anchor': 'middle', class: 'quiet' }),
  ]);
  const rows = y
    .ticks(8)
    .flatMap((dB) => [
      words(left - 8, y(dB) + 4, dB, { 'text-anchor': 'end', class: 'quiet' }),
      tag('line', { class: 'grid', x1: left - 4, x2: left, y1: y(dB), y2: y(dB) }),
    ]);
  const tiers = TIERS.filter(([, dB]) => dB > low && dB < high).flatMap(([name, dB]) => [
    tag('line', { class: 'grid', x1: left, x2: right, y1: y(dB), y2: y(dB) }),
    ...(isSmall
      ? []
      : [words(right, y(dB) - 4, `${name}: ${dB} dB`, { 'text-anchor': 'end', class: 'quiet', 'font-size': 11 })]),
  ]);
  const unit = isSmall ? 'milliseconds a frame (logarithmic)' : 'milliseconds a frame, median (logarithmic)';
  const titles = [
    words((left + right) / 2, bottom + 3.1 * font, unit, { 'text-anchor': 'middle' }),
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

function drawPoints(points, front, { x, y }, { width, height, margin, font, isSmall }) {
  const isNamed = (point) => !isSmall || NAMED_TIERS.includes(point.tier) || front.includes(point);
  const placed = placeLabels(
    points.filter(isNamed).map((point) => ({
      x: x(point.ms),
      y: y(point.psnr),
      text: point.name,
      weight: front.includes(point) || point.tier === 'tier' ? 1 : 0,
    })),
    { left: margin.left, right: width - margin.right, top: margin.top, bottom: height - margin.bottom, font },
  );
  const marks = points.map((point) => {
    const kind = [point.peer ? 'peer' : 'own', !isNamed(point) && 'unnamed'];
    const note = `${point.name}: ${point.ms.toFixed(2)} ms, ${point.psnr.toFixed(1)} dB, worst pixel ${point.worst.toFixed(1)}/255, ${perceptual(point)}`;
    const circle = { class: kind.filter(Boolean).join(' '), cx: x(point.ms), cy: y(point.psnr), r: 5 };
    return tag('circle', circle, tag('title', {}, escape(note)));
  });
  const labels = placed.map(({ text, at, anchor, point, far }) => {
    const line = far ? tag('line', { class: 'leader', x1: point.x, y1: point.y, x2: at.x, y2: at.y - 4 }) : '';
    const weight = point.weight ? { 'font-weight': 600 } : {};
    return line + words(at.x, at.y, text, { class: 'label', 'text-anchor': anchor, ...weight });
  });
  return [...marks, ...labels].join('\n');
}

function drawCaption(report, { margin, height, isSmall, font }) {
  const lines = isSmall ? smallCaption(report) : wholeCaption(report);
  const size = isSmall ? 0.8 * font : 11;
  const left = isSmall ? font : margin.left - 40;
  return lines
    .map((line, i) =>
      words(left, height - 8 - 1.4 * size * (lines.length - 1 - i), line, { class: 'quiet', 'font-size': size }),
    )
    .join('\n');
}

function wholeCaption({ environment, scene, reference, run, standard }) {
  const { versions, date, userAgent } = environment;
  const browser = /(?:Headless)?(?:Chrome|Firefox|Version)\/[\d.]+/.exec(userAgent)?.[0] ?? userAgent;
  const against = reference.kind === 'oracle' ? 'the float64 oracle' : 'our compute rasterizer in float32';
  return [
    `Orange: ours (${versions.commit}); blue: PlayCanvas ${versions.playcanvas}, Spark ${versions.spark}. Milliseconds of a frame of 40 in a row, queue drained once.`,
    `Dashed: nothing else is both faster and more accurate; bold: those, and the qualities. ${scene.views} views of the path “${scene.path}”, covered pixels, against ${against}.`,
    `Scene ${scene.scene.split('/').at(-1)}, ${scene.antialiased ? 'antialiased' : 'classic'}; ${run.rounds} × ${run.frames} frames${standard ? ', each beside the default in turns' : ''}; ${browser}; ${date.slice(0, 10)}.`,
  ];
}

function smallCaption({ environment }) {
  return [
    `Orange: ours, pale: single settings; blue: others. ${environment.date.slice(0, 10)}.`,
    'Milliseconds of a frame of 40 in a row.',
  ];
}
