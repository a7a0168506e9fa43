/**
 * Configurations to measure, from the page's address: one or a list.
 * A configuration's fields, all optional: `name`; `scene` (URL), `splats` (0: as the file has), `layout` (ground,
 * overhead), `visible` (splats on the ground if overhead), `mode` (scene, classic, antialiased); `width`, `height`, `path`,
 * `distance` (of the path from the scene, 1: usual), `resolutionScale`; `options` (of the Renderer) and `pack` (of
 * packGaussians); `peer` (playcanvas, spark) and `parity` instead of the last two; `peer` ours and `build` (URL of the
 * folder of bench pages of another build) for the same configuration in another build.
 */

import { PATH_NAMES } from '../scene/paths.js';
import { PEERS } from './peer.js';

/** Fields that are words, and the words that they may be. */
const WORDS = {
  path: PATH_NAMES,
  layout: ['ground', 'overhead'],
  mode: ['scene', 'classic', 'antialiased'],
  peer: ['', ...PEERS],
};

export const DEFAULTS = Object.freeze({
  name: '',
  scene: '../scenes/skull.spz',
  splats: 0,
  layout: 'ground',
  visible: 250_000,
  mode: 'scene',
  width: 1920,
  height: 1080,
  path: 'orbit',
  distance: 1,
  resolutionScale: 1,
  options: {},
  pack: {},
  peer: '',
  build: '',
  parity: false,
});

export const SIZES_MILLIONS = [0.25, 1, 3, 6.06, 12, 24];

const NUMBERS = ['splats', 'visible', 'width', 'height', 'distance', 'resolutionScale'];
const SHORT = { n: 'splats', w: 'width', h: 'height' };

/** JSON, or the shorter `key=value,key:value`; its numbers and booleans are read as such. */
export function parseObject(text) {
  if (text.trim().startsWith('{')) return JSON.parse(text);
  const value = (word) => {
    if (word === 'true' || word === 'false') return word === 'true';
    return word !== '' && Number.isFinite(Number(word)) ? Number(word) : word;
  };
  const pairs = text.split(',').filter(Boolean);
  return Object.fromEntries(
    pairs.map((pair) => {
      const at = pair.search(/[=:]/);
      if (at < 1) throw new SyntaxError(`expected key=value, found "${pair}"`);
      return [pair.slice(0, at).trim(), value(pair.slice(at + 1).trim())];
    }),
  );
}

/** The fields of a configuration that an address gives. */
function fieldsOf(query) {
  const fields = {};
  for (const [key, text] of query) {
    const name = SHORT[key] ?? key;
    if (!(name in DEFAULTS)) continue;
    if (name === 'options' || name === 'pack') fields[name] = parseObject(text);
    else if (NUMBERS.includes(name)) fields[name] = readNumber(key, text);
    else fields[name] = name === 'parity' ? text !== '' && text !== '0' && text !== 'false' : text;
  }
  if (query.has('raster')) fields.options = { ...fields.options, rasterizer: query.get('raster') };
  return fields;
}

function readNumber(name, text) {
  const value = Number(text);
  if (text === '' || !Number.isFinite(value) || value < 0)
    throw new RangeError(`${name}: expected a number, found "${text}"`);
  return value;
}

/**
 * All configurations that an address asks for: `list` (a JSON array of configurations, or its URL) times `ladder`
 * (millions of splats, or `all`) times `sizes` (1920x1080,3840x2160) times `paths`.
 * @param loadJson reads the JSON behind a URL.
 */
export async function readConfigurations(query, loadJson) {
  const base = { ...DEFAULTS, ...fieldsOf(query) };
  const list = query.has('list') ? await readList(query.get('list'), loadJson) : [{}];
  const axes = [stepsAxis(query.get('ladder')), sizesAxis(query.get('sizes')), pathsAxis(query.get('paths'))];
  let all = list.map((fields) => merge(base, fields));
  for (const axis of axes)
    if (axis) all = all.flatMap((configuration) => axis.map((step) => ({ ...configuration, ...step })));
  all.forEach(checkWords);
  return all.map((configuration) => ({ ...configuration, name: configuration.name || nameOf(configuration) }));
}

function checkWords(configuration) {
  for (const [field, words] of Object.entries(WORDS)) {
    if (words.includes(configuration[field])) continue;
    throw new RangeError(`${field}: expected ${words.filter(Boolean).join(', ')}, found "${configuration[field]}"`);
  }
}

function merge(base, fields) {
  return {
    ...base,
    ...fields,
    options: { ...base.options, ...fields.options },
    pack: { ...base.pack, ...fields.pack },
  };
}

async function readList(text, loadJson) {
  const list = text.trim().startsWith('[') ? JSON.parse(text) : await loadJson(text);
  if (!Array.isArray(list)) throw new TypeError('list: expected a JSON array of configurations');
  return list;
}

const stepsAxis = (text) => {
  if (text === null || text === '') return undefined;
  const millions = text === 'all' ? SIZES_MILLIONS : text.split(',').map((word) => readNumber('ladder', word));
  return millions.map((million) => ({ splats: Math.round(1e6 * million) }));
};

const sizesAxis = (text) =>
  text?.split(',').map((size) => {
    const [, width, height] = /^(\d+)x(\d+)$/.exec(size) ?? [];
    if (!width) throw new RangeError(`sizes: expected for example 1920x1080, found "${size}"`);
    return { width: Number(width), height: Number(height) };
  });

const pathsAxis = (text) => text?.split(',').map((path) => ({ path }));

/** A name that says what differs from the default. */
export function nameOf({ options, pack, resolutionScale, peer, parity }) {
  if (peer) return parity ? `${peer}, parity` : peer;
  const words = Object.entries({ ...options, ...pack }).map(([key, value]) => `${key} ${value}`);
  if (resolutionScale !== 1) words.push(`scale ${resolutionScale}`);
  return words.join(', ') || 'default';
}

/** How to measure: rounds over the list, frames and warm-up frames of each visit, phases, and where to report. */
export function readRun(query) {
  const number = (name, fallback) => (query.has(name) ? readNumber(name, query.get(name)) : fallback);
  return {
    rounds: number('rounds', 3),
    frames: number('frames', 200),
    warmUp: number('warmup', 30),
    phases: (query.get('phases') ?? 'burst,wall,gpu').split(','),
    report: query.get('report'),
  };
}
