/**
 * The page that draws rows of the stability catalog with every subject. `?only=S7` runs one row, `?peers=0` ours alone, `?report=URL` is where
 * the figures are POSTed as JSON.
 */
import { autotune, deviceDescriptor, GaussianBuffers, packGaussians } from '@gaussian-splat/renderer';
import { renderOracle } from '../tests/oracle/oracle.ts';
import { OwnRenderer } from './run/own-renderer.js';
import { openPeer } from './run/peer.js';
import { sendReport } from './run/report.js';
import { writePly } from './peers/ply.js';
import { CASES, truthOf } from './stability/cases.js';
import { judge } from './stability/judge.js';

const SUBJECTS = [
  { name: 'ours' },
  { name: `PlayCanvas ${BENCH_VERSIONS.playcanvas}`, peer: 'playcanvas' },
  { name: `PlayCanvas ${BENCH_VERSIONS.playcanvas}, parity`, peer: 'playcanvas', parity: true },
  { name: `Spark ${BENCH_VERSIONS.spark}`, peer: 'spark' },
  { name: `Spark ${BENCH_VERSIONS.spark}, parity`, peer: 'spark', parity: true },
];
/** A peer that shows nothing must not hold up the others. */
const TIMEOUT_MS = 90_000;

const query = new URLSearchParams(location.search);
const status = document.querySelector('#status');
const table = document.createElement('table');
document.querySelector('#results').append(table);

let report;
try {
  report = await run();
  status.textContent = 'Done.';
} catch (error) {
  report = { error: String(error?.stack ?? error) };
  status.textContent = report.error;
}
await sendReport(report, query.get('report'));

async function run() {
  const adapter = await navigator.gpu.requestAdapter();
  const device = await adapter.requestDevice(deviceDescriptor(adapter));
  await autotune(device);
  const subjects = query.get('peers') === '0' ? SUBJECTS.slice(0, 1) : SUBJECTS;
  addRow('th', ['row', 'reference', ...subjects.map(({ name }) => name)]);
  const rows = [];
  for (const make of CASES) {
    const one = make();
    if (query.has('only') && query.get('only') !== one.row) continue;
    rows.push(await runCase(device, one, subjects));
  }
  const { vendor, architecture, description } = adapter.info ?? {};
  return { versions: BENCH_VERSIONS, adapter: [vendor, architecture, description].filter(Boolean).join(' '), rows };
}

async function runCase(device, one, subjects) {
  const references = referencesOf(one);
  const cells = addRow('td', [`${one.row}: ${one.title}`, photo(references.at(-1).color, 3, one.views[0])]);
  const results = [];
  for (const configuration of subjects) {
    status.textContent = `${one.row}, ${one.title}: ${configuration.name}`;
    window.onBenchProgress?.(status.textContent);
    const result = await runSubject(device, one, configuration, references);
    cells.append(cellOf(result, one));
    results.push({
      subject: configuration.name,
      figure: result.figure,
      unit: result.unit,
      passes: result.passes,
      error: result.error,
    });
  }
  const { row, title, least: min, most: max } = one;
  return { row, title, least: min, most: max, results };
}

function referencesOf(one) {
  const { cloud, views } = truthOf(one);
  return views.map((camera) => {
    const { color, contributors } = renderOracle(cloud, camera, { rules: 'gsplat', mode: 'classic' });
    return { color: Float32Array.from(color), covered: Uint8Array.from(contributors, (n) => (n > 0 ? 1 : 0)) };
  });
}

async function runSubject(device, one, configuration, references) {
  let close = () => {};
  try {
    const open = configuration.peer ? openOther(one, configuration) : openOurs(device, one);
    const { subject, end } = await within(open);
    close = end;
    return await within(judge(subject, one, references));
  } catch (error) {
    return { figure: null, unit: '', passes: false, error: String(error?.message ?? error) };
  } finally {
    close();
  }
}

async function openOurs(device, { cloud, views: [{ width, height }] }) {
  const gaussians = await GaussianBuffers.upload(device, packGaussians(cloud));
  const own = new OwnRenderer(device, { buffers: [gaussians] }, { options: {}, resolutionScale: 1, width, height });
  const subject = { capture: (view) => own.capture(view), snapshot: (view) => own.capture(view) };
  const end = () => {
    own.close();
    gaussians.destroy();
  };
  return { subject, end };
}

async function openOther({ cloud, views: [{ width, height }] }, { peer, parity = false }) {
  const ply = writePly(cloud, [{ offset: [0, 0, 0], length: cloud.count }]);
  const subject = await openPeer({ peer, parity, antialiased: false, width, height }, ply);
  return { subject, end: () => subject.dispose() };
}

function within(promise) {
  const late = new Promise((_, reject) => {
    setTimeout(() => reject(new Error(`no frame within ${TIMEOUT_MS / 1000} s`)), TIMEOUT_MS);
  });
  return Promise.race([promise, late]);
}

function addRow(kind, contents) {
  const row = document.createElement('tr');
  for (const content of contents) {
    const cell = document.createElement(kind);
    cell.append(content);
    row.append(cell);
  }
  table.append(row);
  return row;
}

function cellOf({ figure, unit, passes, image, error }, { views: [camera] }) {
  const cell = document.createElement('td');
  if (image) cell.append(photo(image, 4, camera));
  const line = document.createElement('p');
  line.textContent = error ?? `${passes ? 'passes' : 'fails'}: ${Number(figure.toFixed(1))} ${unit}`;
  cell.append(line);
  return cell;
}

/** Pixels over black, as a canvas. */
function photo(values, channels, { width, height }) {
  const canvas = document.createElement('canvas');
  [canvas.width, canvas.height] = [width, height];
  const data = new ImageData(width, height);
  for (let i = 0; i < width * height; i++) {
    for (let k = 0; k < 3; k++) data.data[4 * i + k] = 255 * values[channels * i + k];
    data.data[4 * i + 3] = 255;
  }
  canvas.getContext('2d').putImageData(data, 0, 0);
  return canvas;
}
