/** Fields to attributes, attributes to HTML. The fields are made from the element's manifest when the site is built. */
import { copy } from '../site/copy.js';
import { addressOf, takeFiles } from '../site/local-file.js';
import { viewOf } from '../site/view.js';
import { frameOf, scriptOf, tagOf } from './html.js';
import { askForLevel, turnedOver } from './level.js';

const byId = (id) => document.getElementById(id);
const scene = byId('scene');
const form = byId('attributes');
/** Attributes that are addresses: pasted elsewhere, they must still lead here. */
const ADDRESSES = ['src', 'poster', 'contract'];
/** And those that are several, with spaces between them. */
const LISTS = ['chain', 'postprocess'];
/** The element's build, which this site has, too. */
const CDN = new URL('../cdn/', document.baseURI).href;
const VIEW = ['camera-orbit', 'camera-target', 'field-of-view'];

/** The file that was dropped, while its name stands in the field of the source. */
let local = { name: '', address: '' };

/** What the fields say: `[name, value]`, true for a bare attribute. Empty fields set nothing; `alt` and `src` come first. */
function chosen() {
  return [...form.elements]
    .filter(({ name }) => name)
    .map(({ name, type, checked, value }) => [name, type === 'checkbox' ? checked : value.trim()])
    .filter(([, value]) => value !== '' && value !== false)
    .sort(([a], [b]) => rankOf(a) - rankOf(b));
}

const FIRST = ['src', 'alt', 'poster'];
const rankOf = (name) => (FIRST.includes(name) ? FIRST.indexOf(name) : FIRST.length);

function show() {
  const attributes = chosen();
  for (const { name } of form.elements) {
    if (!name) continue;
    const [, value] = attributes.find(([each]) => each === name) ?? [];
    setAttribute(name, name === 'src' && value === local.name ? local.address : value);
  }
  byId('html').textContent = `${scriptOf(CDN)}\n${tagOf(pasteableOf(attributes))}`;
  byId('copied').textContent = '';
  remember(attributes);
}

function setAttribute(name, value) {
  const wanted = value === true ? '' : (value ?? null);
  if (wanted === scene.getAttribute(name)) return;
  if (wanted === null) scene.removeAttribute(name);
  else scene.setAttribute(name, wanted);
}

const pasteableOf = (attributes) => attributes.map(([name, value]) => [name, pasteable(name, value)]);

function pasteable(name, value) {
  if (LISTS.includes(name)) return value.split(/\s+/).map(absolute).join(' ');
  if (!ADDRESSES.includes(name) || value === local.name || value.startsWith('{')) return value;
  return absolute(value);
}

const absolute = (address) =>
  URL.canParse(address, document.baseURI) ? new URL(address, document.baseURI).href : address;

/** The page's address says what the fields say, so that it can be sent to somebody. A file stays where it is. */
function remember(attributes) {
  const query = new URLSearchParams();
  for (const [name, value] of attributes) if (value !== local.name) query.set(name, value === true ? '' : value);
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
}

/** Where the camera is, as attributes: into the fields, the HTML and the clipboard. */
async function copyView() {
  for (const [name, value] of Object.entries(viewOf(scene))) form.elements[name].value = value;
  show();
  byId('copied').textContent = await copy(byId('html').textContent);
}

/** What can only be had here: a file that was dropped is on no server. */
async function copyUnlessLocal(textOf) {
  if (form.elements.src.value === local.name)
    byId('copied').textContent = 'Your file is in this browser only. Put it on a server, and name its address as src.';
  else byId('copied').textContent = await copy(textOf());
}

/** The other way up: files such as SPZ do not say which, and tools do not agree. */
function flip() {
  asking.abort();
  for (const name of VIEW) form.elements[name].value = '';
  form.elements.up.value = turnedOver(scene);
  show();
}

let asking = new AbortController();

/** Asks for three points of the floor, and says in `up` what they come to; what was said of the view meant another one. */
async function level() {
  asking.abort();
  asking = new AbortController();
  const say = (sentence) => (byId('copied').textContent = sentence);
  try {
    const up = await askForLevel(scene, say, asking.signal);
    for (const name of VIEW) form.elements[name].value = '';
    form.elements.up.value = up;
    show();
    say('Upright. If it stands on its head, look at the floor from above and try again.');
  } catch {
    // Something else is asked for, or another scene is there.
  }
}

scene.addEventListener('loadstart', () => asking.abort());
scene.addEventListener('load', () => {
  const { splats, bytes } = scene.statistics;
  byId('status').textContent = `${splats.toLocaleString('en')} splats, ${(bytes / 1e6).toFixed(1)} MB of GPU memory`;
  for (const id of ['copy-view', 'copy-link', 'level', 'flip']) byId(id).disabled = false;
});
scene.addEventListener('loadstart', () => (byId('status').textContent = 'Loading'));
for (const type of ['error', 'generator-error']) {
  scene.addEventListener(type, ({ detail }) => (byId('status').textContent = detail.message));
}
form.addEventListener('change', show);
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
  show();
  scene.resetCamera();
});
takeFiles(byId('drop'), (file) => {
  local = { name: file.name, address: addressOf(file) };
  form.elements.src.value = file.name;
  form.elements.alt.value = '';
  for (const name of VIEW) form.elements[name].value = '';
  show();
  // On a phone the field lies below the scene, which waits until it is seen.
  scene.scrollIntoView({ block: 'nearest' });
});
recall();
show();
