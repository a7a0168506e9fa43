/** Two elements, one camera, one line between their images. */
import { addressOf, takeFiles } from '../site/local-file.js';
import { adapterName, measureInTurns } from '../site/measure.js';
import { differenceOf } from './difference.js';
import { align, keepInStep } from './in-step.js';

const byId = (id) => document.getElementById(id);
const query = new URLSearchParams(location.search);
const [left, right] = ['left', 'right'].map(byId);
const sides = [left, right];

/** Applies the settings of one side to its element and to the caption. */
function apply(element) {
  const quality = byId(`${element.id}-quality`).value;
  const degree = byId(`${element.id}-degree`).value;
  element.setAttribute('quality', quality);
  element.setAttribute('max-sh-degree', degree);
  byId(`${element.id}-name`).textContent = `${quality}, degree ${degree}`;
  markPrepared();
}

function choose(element, words) {
  const [quality, degree] = words.split(',');
  byId(`${element.id}-quality`).value = quality;
  byId(`${element.id}-degree`).value = degree ?? '3';
  apply(element);
}

function moveLine() {
  byId('pair').style.setProperty('--split', `${byId('split').value}%`);
}

/** A finger or a mouse drags the line; the keyboard has the slider below. */
function dragLine(divider) {
  const follow = ({ clientX }) => {
    const { left: start, width } = byId('pair').getBoundingClientRect();
    byId('split').value = (100 * (clientX - start)) / width;
    moveLine();
  };
  divider.addEventListener('pointerdown', (event) => {
    divider.setPointerCapture(event.pointerId);
    follow(event);
  });
  divider.addEventListener('pointermove', (event) => divider.hasPointerCapture(event.pointerId) && follow(event));
}

/** The prepared pair that is visible, if any. */
function markPrepared() {
  const chosen = sides.map(({ id }) => `${byId(`${id}-quality`).value},${byId(`${id}-degree`).value}`);
  for (const button of document.querySelectorAll('[data-left]')) {
    const isShown = button.dataset.left === chosen[0] && button.dataset.right === chosen[1];
    button.setAttribute('aria-pressed', String(isShown));
  }
}

async function measure() {
  byId('status').textContent = 'Measuring…';
  byId('measure').disabled = true;
  try {
    const times = await measureInTurns(sides);
    align(left, right);
    const { decibels, worst } = await differenceOf(left, right);
    const rows = sides.map((element, i) => [
      byId(`${element.id}-name`).textContent,
      times[i].isEnough ? String(Number(times[i].median.toPrecision(2))) : 'too slow to measure',
      decibels === Infinity ? 'the same' : decibels.toFixed(1),
      String(worst),
    ]);
    byId('figures').tBodies[0].replaceChildren(...rows.map(rowOf));
    byId('figures').hidden = false;
    const { width, height, frames } = times[0];
    byId('status').textContent =
      `${width} × ${height} pixels, ${frames} frames of each in turns, on ${await adapterName()}.`;
  } catch (error) {
    byId('status').textContent = error.message;
  }
  byId('measure').disabled = false;
}

function rowOf(texts) {
  const row = document.createElement('tr');
  row.append(...texts.map((text) => Object.assign(document.createElement('td'), { textContent: text })));
  return row;
}

choose(left, query.get('left') ?? 'default,3');
choose(right, query.get('right') ?? 'fast,3');
for (const element of sides) {
  if (query.has('src')) element.src = query.get('src');
  element.addEventListener('load', () => (byId('measure').disabled = !sides.every(({ loaded }) => loaded)));
  element.addEventListener('error', () => (byId('status').textContent = element.error.message));
  for (const name of ['quality', 'degree'])
    byId(`${element.id}-${name}`).addEventListener('change', () => apply(element));
}
keepInStep(left, right);
byId('split').addEventListener('input', moveLine);
dragLine(byId('divider'));
byId('measure').addEventListener('click', measure);
for (const button of document.querySelectorAll('[data-left]')) {
  button.addEventListener('click', () => {
    choose(left, button.dataset.left);
    choose(right, button.dataset.right);
  });
}
takeFiles(byId('drop'), (file) => {
  const address = addressOf(file);
  for (const element of sides) Object.assign(element, { src: address, cameraOrbit: null, cameraTarget: null });
});
moveLine();
