/** Fields to attributes, attributes to HTML. The fields are made from the element's manifest when the site is built. */
import { copy } from '../site/copy.js';
import { addressOf, takeFiles } from '../site/local-file.js';
import { viewOf } from '../site/view.js';
import { Children } from './children.js';
import { Crop } from './crop.js';
import { faultOf, showFault } from './faults.js';
import { frameOf, pageOf, sceneOf, scriptOf, tagsOf } from './html.js';
import { askForLevel, turnedOver } from './level.js';
import { pickPoint } from './pick.js';
import { alignSliders, connectSliders } from './sliders.js';

const byId = (id) => document.getElementById(id);
const scene = byId('scene');
const form = byId('attributes');
/** Attributes that are addresses: pasted elsewhere, they must still lead here. */
const ADDRESSES = ['src', 'poster', 'contract'];
/** And those that are several, with spaces between them. */
const LISTS = ['chain', 'postprocess'];
/** The element's build, which this site has, too. */
const CDN = new URL('../cdn/', document.baseURI).href;
/** Fields whose changes load a file at once. */
const LOADED = ['src', 'crop', 'views', ...ADDRESSES, ...LISTS];
const VIEW = ['camera-orbit', 'camera-target', 'field-of-view'];

/** The file that was dropped, while its name stands in the field of the source. */
let local = { name: '', address: '' };
/** The name of the poster that was saved. */
let savedPoster = '';
const children = new Children(scene, byId('children'), show);
const crop = new Crop(scene, form.elements.crop, form.querySelectorAll('[data-side]'), show);

/** The values of the fields: `[name, value]`, true for a bare attribute. Empty fields, and values that the element would not take, set nothing; `alt` and `src` come first. */
function chosen() {
  return [...form.elements]
    .filter(({ name }) => name)
    .map(({ name, type, checked, value }) => [name, type === 'checkbox' ? checked : value.trim()])
    .filter(([name, value]) => value !== '' && value !== false && faultOf(name, value) === '')
    .sort(([a], [b]) => rankOf(a) - rankOf(b));
}

const FIRST = ['src', 'alt', 'poster'];
const rankOf = (name) => (FIRST.includes(name) ? FIRST.indexOf(name) : FIRST.length);

function show() {
  const attributes = chosen();
  for (const field of form.elements) {
    const { name, type, value } = field;
    if (name && type !== 'checkbox') showFault(field, faultOf(name, value.trim()));
  }
  setTags(tagsOf(attributes));
  alignSliders(form);
  crop.align();
  byId('html').textContent = `${scriptOf(CDN)}\n${sceneHtml(attributes)}`;
  byId('copied').textContent = '';
  remember(attributes);
}

/** The tag of a scene that is cropped. */
const cropped = document.createElement('splat-scene');

/** A scene that changes its tag is loaded again. It leaves the one before it comes to the other, so that its memory is not taken twice. */
function setTags(tags) {
  const isCropped = tags.scene !== null;
  if (isCropped !== cropped.isConnected) kept = turnedTo();
  if (!isCropped) cropped.remove();
  setAttributes(scene, tags.element);
  setAttributes(cropped, tags.scene ?? []);
  if (isCropped && !cropped.isConnected) scene.append(cropped);
}

/** Whether a visitor has moved the camera since the fields last set it. */
let isTurned = false;
/** The view that comes back once the scene is loaded again. */
let kept;

/** The visitor's camera position as a target of `flyTo()`. */
function turnedTo() {
  if (!isTurned) return undefined;
  const [orbit, target, fieldOfView] = [scene.getCameraOrbit(), scene.getCameraTarget(), scene.getFieldOfView()];
  return { orbit: String(orbit), target: String(target), fieldOfView: String(fieldOfView) };
}

/** Frames the remaining part of the scene, as a page with this HTML would; a visitor's view stays. */
async function frameAgain() {
  const view = turnedTo();
  await scene.updateFraming();
  if (view) await scene.flyTo(view, { duration: 0 });
}

/** Sets the given attributes, and removes all others that have a field in the form. */
function setAttributes(element, attributes) {
  const values = new Map(attributes);
  for (const { name } of form.elements) {
    if (!name) continue;
    const value = values.get(name);
    setAttribute(element, name, name === 'src' && value === local.name ? local.address : value);
  }
}

function setAttribute(element, name, value) {
  const wanted = value === true ? '' : (value ?? null);
  if (wanted === element.getAttribute(name)) return;
  if (wanted === null) element.removeAttribute(name);
  else element.setAttribute(name, wanted);
}

/** The tag to paste, with labels, views, and the poster that was saved. */
function sceneHtml(attributes) {
  const poster = savedPoster && !form.elements.poster.value ? [['poster', savedPoster]] : [];
  return sceneOf([...pasteableOf(attributes), ...poster], children.html);
}

const pasteableOf = (attributes) => attributes.map(([name, value]) => [name, pasteable(name, value)]);

function pasteable(name, value) {
  if (LISTS.includes(name)) return value.split(/\s+/).map(absolute).join(' ');
  if (!ADDRESSES.includes(name) || value === local.name || value.startsWith('{')) return value;
  return absolute(value);
}

const absolute = (address) =>
  URL.canParse(address, document.baseURI) ? new URL(address, document.baseURI).href : address;

/**
 * The page's address contains the values of the fields, so that it can be sent. A file stays local: only its name is
 * kept.
 */
function remember(attributes) {
  const query = new URLSearchParams();
  for (const [name, value] of attributes) query.set(value === local.name ? 'file' : name, value === true ? '' : value);
  history.replaceState(null, '', `?${query}`);
}

/** Fields from the page's address; without one they are as the page has them. */
function recall() {
  const query = new URLSearchParams(location.search);
  if (query.size === 0) return;
  for (const field of form.elements) {
    if (!field.name) continue;
    if (field.type === 'checkbox') field.checked = query.has(field.name);
    else field.value = query.get(field.name) ?? '';
  }
  if (query.has('file'))
    byId('status').textContent = `${query.get('file')} was in your browser only. Drop it on this page again.`;
}

/** Writes the camera's position as attributes into the fields, the HTML and the clipboard. */
async function copyView() {
  for (const [name, value] of Object.entries(viewOf(scene))) form.elements[name].value = value;
  show();
  byId('copied').textContent = await copy(byId('html').textContent);
}

/** Local files are available only here: a dropped file is on no server. */
async function copyUnlessLocal(textOf) {
  if (form.elements.src.value === local.name)
    byId('copied').textContent = 'Your file is in this browser only. Put it on a server, and name its address as src.';
  else byId('copied').textContent = await copy(textOf());
}

/** The other way up: files such as SPZ do not say which, and tools do not agree. */
function flip() {
  asking.abort();
  isTurned = false;
  for (const name of VIEW) form.elements[name].value = '';
  form.elements.up.value = turnedOver(scene);
  show();
}

let asking = new AbortController();

/**
 * Asks for three points of the floor, and writes the result into `up`. Fields of the view refer to the old direction.
 */
async function level() {
  asking.abort();
  asking = new AbortController();
  const say = (sentence) => (byId('copied').textContent = sentence);
  try {
    const up = await askForLevel(scene, say, asking.signal);
    isTurned = false;
    for (const name of VIEW) form.elements[name].value = '';
    form.elements.up.value = up;
    show();
    say('Upright. If it stands on its head, look at the floor from above and try again.');
  } catch {
    // Another button was pressed, or another scene is shown.
  }
}

/** Puts a label at the visitor's next click. */
async function label() {
  asking.abort();
  asking = new AbortController();
  byId('copied').textContent = 'Click on the scene, where the label belongs.';
  try {
    const point = await pickPoint(scene, asking.signal);
    if (point !== null) children.addLabel(point);
    else byId('copied').textContent = 'There is nothing of the scene at this point. Press the button again.';
  } catch {
    // Another button was pressed, or another scene is shown.
  }
}

const POSTER = 'poster.webp';

/** An image of the view as a file, which the HTML then names. */
async function savePoster() {
  const { width, height } = scene.getBoundingClientRect();
  const wide = Math.min(1600, Math.round(2 * width));
  const image = await scene.toBlob({
    mimeType: 'image/webp',
    width: wide,
    height: Math.round((wide * height) / width),
  });
  const square = await squareOf(image);
  download(square ?? image, POSTER);
  savedPoster = POSTER;
  show();
  const fits = square ? ' It fits every shape with the style --poster-fit: contain.' : '';
  byId('copied').textContent = `Put ${POSTER} beside your page.${fits}`;
}

/** The square in the middle of an image, in which scenes are framed; undefined if there is something beside it. */
async function squareOf(image) {
  const bitmap = await createImageBitmap(image);
  const side = Math.min(bitmap.width, bitmap.height);
  const [x, y] = [bitmap.width, bitmap.height].map((length) => Math.floor((length - side) / 2));
  const context = new OffscreenCanvas(bitmap.width, bitmap.height).getContext('2d');
  context.drawImage(bitmap, 0, 0);
  const { data } = context.getImageData(0, 0, bitmap.width, bitmap.height);
  const isInside = (i) => {
    const [column, row] = [i % bitmap.width, Math.floor(i / bitmap.width)];
    return column >= x && column < x + side && row >= y && row < y + side;
  };
  for (let i = 0; 4 * i < data.length; i++) if (data[4 * i + 3] > 8 && !isInside(i)) return undefined;
  const canvas = new OffscreenCanvas(side, side);
  canvas.getContext('2d').drawImage(bitmap, -x, -y);
  return canvas.convertToBlob({ type: 'image/webp', quality: 0.9 });
}

/** A page to open, with the same scene in it. */
function savePage() {
  const attributes = chosen();
  const [, title = 'A scene'] = attributes.find(([name]) => name === 'alt') ?? [];
  download(new Blob([pageOf(scriptOf(CDN), sceneHtml(attributes), title)], { type: 'text/html' }), 'index.html');
  byId('copied').textContent =
    form.elements.src.value === local.name ? `Put ${local.name} beside the page, and serve both.` : 'Saved.';
}

function download(blob, name) {
  const link = Object.assign(document.createElement('a'), { href: URL.createObjectURL(blob), download: name });
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 60_000);
}

scene.addEventListener('loadstart', () => asking.abort());
scene.addEventListener('load', () => {
  const {
    splats,
    bytes: { scene: bytes },
  } = scene.stats;
  byId('status').textContent = `${splats.toLocaleString('en')} splats, ${(bytes / 1e6).toFixed(1)} MB of GPU memory`;
  for (const button of document.querySelectorAll('.result button')) button.disabled = false;
  crop.measure();
  if (kept) scene.flyTo(kept, { duration: 0 });
  kept = undefined;
});
scene.addEventListener('loadstart', () => {
  byId('status').textContent = 'Loading';
  crop.forget();
});
scene.addEventListener('camera-change', ({ detail }) => (isTurned ||= detail.source === 'user-interaction'));
for (const type of ['error', 'generator-error']) {
  scene.addEventListener(type, ({ detail }) => {
    byId('status').textContent = detail.message;
    kept = undefined;
  });
}
// A box belongs to the scene that it was made for.
form.elements.src.addEventListener('change', () => {
  form.elements.crop.value = '';
  isTurned = false;
});
form.addEventListener('change', ({ target }) => {
  if (VIEW.includes(target.name ?? '')) isTurned = false;
  show();
  if (target.name === 'crop' || target.dataset.side) void frameAgain();
});
form.addEventListener('input', ({ target }) => {
  // An address is no address before it is complete, and a box that is no box would load the scene again.
  if (target.type !== 'range' && !LOADED.includes(target.name)) show();
});
connectSliders(form, show);
byId('add-label').addEventListener('click', label);
byId('add-view').addEventListener('click', () => children.addView(viewOf(scene)));
byId('save-poster').addEventListener('click', savePoster);
byId('save-page').addEventListener('click', savePage);
form.addEventListener('submit', (event) => event.preventDefault());
byId('copy-view').addEventListener('click', copyView);
byId('level').addEventListener('click', level);
byId('copy-frame').addEventListener('click', () => copyUnlessLocal(() => frameOf(CDN, pasteableOf(chosen()))));
byId('copy-link').addEventListener('click', () => {
  for (const [name, value] of Object.entries(viewOf(scene))) form.elements[name].value = value;
  show();
  return copyUnlessLocal(() => location.href);
});
byId('flip').addEventListener('click', flip);
byId('copy').addEventListener('click', async () => {
  byId('copied').textContent = await copy(byId('html').textContent);
});
byId('reset').addEventListener('click', () => {
  asking.abort();
  form.reset();
  isTurned = false;
  children.clear();
  savedPoster = '';
  show();
  scene.resetCamera();
});
takeFiles(document.documentElement, (file) => {
  local = { name: file.name, address: addressOf(file) };
  form.elements.src.value = file.name;
  form.elements.alt.value = '';
  for (const name of [...VIEW, 'crop']) form.elements[name].value = '';
  isTurned = false;
  children.clear();
  savedPoster = '';
  show();
  // On a phone the field lies below the scene, which waits until it is seen.
  scene.scrollIntoView({ block: 'nearest' });
});
recall();
show();
