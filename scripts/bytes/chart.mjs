/** The chart of bytes against accuracy as SVG: bytes a splat of the source on a logarithmic axis, PSNR of the worst held-out view upwards. */
import { scaleLinear, scaleLog } from 'd3-scale';
import { styleOf, tag, words, escape } from '../charts/svg.mjs';
import { placeLabels } from '../frontier/labels.mjs';

const FONT = 12;
const WIDTH = 920;
const PANEL = 400;
const MARGIN = { left: 64, right: 24, top: 74, bottom: 58 };

/** @param report of run-bytes.mjs: a panel for each scene */
export function drawChart({ scenes, date }) {
  const height = 30 + scenes.length * PANEL;
  const panels = scenes.map((scene, k) => tag('g', { transform: `translate(0 ${k * PANEL})` }, drawPanel(scene)));
  const caption = `Orange: ours; blue: others. Held-out views, 480×270, covered pixels; date ${date.slice(0, 10)}. Up is more accurate, left is smaller.`;
  const parts = [
    tag('style', {}, styleOf({ font: FONT })),
    tag('rect', { width: WIDTH, height, fill: 'var(--ground)' }),
    ...panels,
    words(MARGIN.left - 40, height - 10, caption, { class: 'quiet', 'font-size': 11 }),
  ];
  const title = tag('title', {}, 'Bytes against accuracy of files of Gaussian splats');
  const box = { xmlns: 'http://www.w3.org/2000/svg', viewBox: `0 0 ${WIDTH} ${height}`, role: 'img' };
  return `${tag('svg', box, `${title}\n${parts.join('\n')}\n`)}\n`;
}

function drawPanel({ name, splats, shDegree, rows }) {
  const points = rows.filter(({ worst }) => worst < 90);
  const sizes = points.map(({ bytes }) => bytes / splats);
  const accuracies = points.map(({ worst }) => worst);
  const x = scaleLog([Math.min(...sizes) / 1.3, Math.max(...sizes) * 1.5], [MARGIN.left, WIDTH - MARGIN.right]);
  const y = scaleLinear(
    [Math.min(...accuracies) - 3, Math.max(...accuracies) + 4],
    [PANEL - MARGIN.bottom, MARGIN.top],
  );
  const [bottom, top] = y.range();
  const columns = x
    .ticks(12)
    .flatMap((bytes) => [
      tag('line', { class: 'grid', x1: x(bytes), x2: x(bytes), y1: top, y2: bottom }),
      words(x(bytes), bottom + 18, bytes, { 'text-anchor': 'middle', class: 'quiet' }),
    ]);
  const lines = y
    .ticks(6)
    .flatMap((dB) => [
      tag('line', { class: 'grid', x1: MARGIN.left, x2: WIDTH - MARGIN.right, y1: y(dB), y2: y(dB) }),
      words(MARGIN.left - 8, y(dB) + 4, dB, { 'text-anchor': 'end', class: 'quiet' }),
    ]);
  const placed = placeLabels(
    points.map((point) => ({
      ...{ x: x(point.bytes / splats), y: y(point.worst), text: point.name },
      weight: point.isOwn ? 1 : 0,
    })),
    { left: MARGIN.left, right: WIDTH - MARGIN.right, top, bottom, font: FONT },
  );
  const marks = points.map((point) => {
    const note = `${point.name}: ${point.bytes} bytes, ${point.worst.toFixed(1)} dB`;
    const circle = { class: point.isOwn ? 'own' : 'peer', cx: x(point.bytes / splats), cy: y(point.worst), r: 5 };
    return tag('circle', circle, tag('title', {}, escape(note)));
  });
  const labels = placed.map(({ text, at, anchor, point, far }) => {
    const line = far ? tag('line', { class: 'leader', x1: point.x, y1: point.y, x2: at.x, y2: at.y - 4 }) : '';
    return line + words(at.x, at.y, text, { class: 'label', 'text-anchor': anchor });
  });
  return [
    words(MARGIN.left, 34, `${name}: ${splats.toLocaleString('en')} splats of degree ${shDegree}`, {
      'font-size': 16,
      'font-weight': 600,
    }),
    words(MARGIN.left, 54, 'PSNR of the worst held-out view, dB, against bytes a splat of the source (logarithmic)', {
      class: 'quiet',
    }),
    ...columns,
    ...lines,
    ...marks,
    ...labels,
  ].join('\n');
}
