import assert from 'node:assert/strict';
import { test } from 'node:test';
import fc from 'fast-check';
import {
  credentialsOf,
  type RawAttributes,
  ALL_ATTRIBUTES,
  readAttributes,
  MESH_ATTRIBUTES,
  SCENE_ATTRIBUTES,
} from '../support/element/parts.js';
import {
  fieldOfViewGrammar,
  numberGrammar,
  orbitGrammar,
  readAttribute,
  targetGrammar,
  upGrammar,
  type AttributeGrammar,
  lengthGrammar,
  optionalLengthGrammar,
  CameraOrbit,
  CameraTarget,
  FieldOfView,
} from '../support/element/camera.js';

const orbit = orbitGrammar('0deg 75deg auto');
const DEGREE = Math.PI / 180;

const ABSENT = {} as RawAttributes;

test('the default of each attribute fits its own grammar', () => {
  for (const table of [ALL_ATTRIBUTES, SCENE_ATTRIBUTES, MESH_ATTRIBUTES] as const)
    for (const [name, { grammar }] of Object.entries(table as Record<string, { grammar?: AttributeGrammar<unknown> }>))
      if (grammar) assert.notEqual(grammar.parse(grammar.fallback), null, name);
});

test('detail: a word, or pixels', () => {
  const detailOf = (detail: string): unknown => readAttributes({ ...ABSENT, detail }, assert.fail).detail;
  assert.deepEqual(['auto', ' OFF ', '1px', '.5PX', '0px', '64px'].map(detailOf), ['auto', 'off', 1, 0.5, 0, 64]);
  for (const detail of ['1', '-1px', '65px', 'on', '1 px', 'NaNpx', '1e1px']) {
    const said: string[] = [];
    assert.equal(readAttributes({ ...ABSENT, detail }, (sentence) => said.push(sentence)).detail, 'auto', detail);
    assert.equal(said.length, 1, detail);
  }
});

test('lengths of late code: above 0, with a unit', () => {
  const read = <T>(written: string | null, grammar: AttributeGrammar<T>, warn: (sentence: string) => void): T =>
    readAttribute('length', written, grammar, warn);
  assert.equal(read(null, lengthGrammar('1.6m'), assert.fail), 1.6);
  assert.equal(read(null, optionalLengthGrammar, assert.fail), undefined);
  assert.equal(read('120cm', lengthGrammar('1.6m'), assert.fail), 1.2);
  assert.equal(read(' 37CM ', optionalLengthGrammar, assert.fail), 0.37);
  for (const malformed of ['1', '0m', '-1m', 'auto', '1 m', '1km']) {
    const said: string[] = [];
    assert.equal(
      read(malformed, lengthGrammar('1.6m'), (text) => said.push(text)),
      1.6,
    );
    assert.equal(
      read(malformed, optionalLengthGrammar, (text) => said.push(text)),
      undefined,
    );
    assert.equal(said.length, 2, malformed);
  }
});

test('orbits', () => {
  assert.deepEqual(orbit.parse('90deg 1rad 2m'), { theta: 90 * DEGREE, phi: 1, radius: { meters: 2 } });
  assert.deepEqual(orbit.parse('  -10.5deg\t0   150cm '), { theta: -10.5 * DEGREE, phi: 0, radius: { meters: 1.5 } });
  assert.deepEqual(orbit.parse('auto auto 105%'), { theta: 'auto', phi: 'auto', radius: { framings: 1.05 } });
  assert.deepEqual(orbit.parse('auto'), { theta: 'auto', phi: 'auto', radius: 'auto' });
  // As in <model-viewer>, omitted values at the end are automatic.
  assert.deepEqual(orbit.parse('45deg'), { theta: 45 * DEGREE, phi: 'auto', radius: 'auto' });
  assert.deepEqual(orbit.parse('45deg 1rad'), { theta: 45 * DEGREE, phi: 1, radius: 'auto' });
  assert.deepEqual(orbit.parse('1E1DEG .5rad 20MM'), { theta: 10 * DEGREE, phi: 0.5, radius: { meters: 0.02 } });
});

test('malformed orbits', () => {
  const malformed = [
    '1m',
    '1deg 2m',
    '1deg 2deg 3m 4m',
    '1 2 3',
    '1deg 2deg 3deg',
    '1m 2deg 3m',
    '1deg 2deg -1m',
    '1deg 2deg 0m',
    '1deg 2deg 0%',
    'NaNdeg 0 1m',
    '1e999deg 0 1m',
    'calc(1deg) 0 1m',
    '1deg,2deg,3m',
    '1degg 0 1m',
  ];
  for (const text of malformed) assert.equal(orbit.parse(text), null, text);
});

test('targets, fields of view, axes and numbers', () => {
  assert.deepEqual(targetGrammar.parse('1 -2 3cm'), [1, -2, 0.03]);
  assert.deepEqual(targetGrammar.parse('auto 0 auto'), ['auto', 0, 'auto']);
  assert.deepEqual(targetGrammar.parse('auto'), ['auto', 'auto', 'auto']);
  assert.deepEqual(targetGrammar.parse('1 2'), [1, 2, 'auto']);
  for (const text of ['1deg 2 3', '1 2 3 4', 'x']) assert.equal(targetGrammar.parse(text), null, text);
  assert.equal(fieldOfViewGrammar.parse('45deg'), 45 * DEGREE);
  assert.equal(fieldOfViewGrammar.parse('auto'), 'auto');
  for (const text of ['0deg', '180deg', '-5deg', '45', '45m', ''])
    assert.equal(fieldOfViewGrammar.parse(text), null, text);
  assert.deepEqual(upGrammar.parse(' -Z '), [0, 0, -1]);
  assert.deepEqual(upGrammar.parse('0 -3 4'), [0, -0.6, 0.8]);
  for (const text of ['down', '--y', 'x y', '1 2', '0 0 0', '0 1deg 0', '1 auto 0'])
    assert.equal(upGrammar.parse(text), null, text);
  const decay = numberGrammar(50, 0, 'milliseconds');
  assert.equal(decay.parse('0'), 0);
  for (const text of ['-1', 'fast', '', ' ', 'NaN']) assert.equal(decay.parse(text), null, text);
});

test('what the getters print, the attributes read back to the last bit', () => {
  const number = fc.double({ min: -1e9, max: 1e9, noNaN: true });
  const positive = fc.double({ min: 1e-9, max: 1e9, noNaN: true });
  fc.assert(
    fc.property(number, number, positive, (theta, phi, radius) => {
      const parsed = orbit.parse(new CameraOrbit(theta, phi, radius, 1).toString());
      // Printing loses the sign of zero, which means nothing here.
      assert.deepEqual(parsed, { theta: theta + 0, phi: phi + 0, radius: { meters: radius } });
    }),
  );
  fc.assert(
    fc.property(number, number, number, (x, y, z) => {
      assert.deepEqual(targetGrammar.parse(new CameraTarget(x, y, z).toString()), [x + 0, y + 0, z + 0]);
    }),
  );
  fc.assert(
    fc.property(fc.double({ min: 1e-6, max: 3.14, noNaN: true }), (radians) => {
      assert.equal(fieldOfViewGrammar.parse(new FieldOfView(radians).toString()), radians);
    }),
  );
});

test('no text makes a grammar throw or yield a number that is not finite', () => {
  const text = fc.oneof(
    fc.string(),
    fc.array(fc.constantFrom('1', 'e', '-', '.', 'deg', 'm', '%', ' ', 'auto')).map((a) => a.join('')),
  );
  const isSound = (value: unknown): boolean =>
    typeof value === 'number'
      ? Number.isFinite(value)
      : Object(value) !== value || Object.values(value as object).every(isSound);
  fc.assert(
    fc.property(text, (attribute) => {
      for (const grammar of [orbit, targetGrammar, fieldOfViewGrammar]) assert.ok(isSound(grammar.parse(attribute)));
    }),
  );
});

test('an absent attribute takes its default in silence', () => {
  const warnings: string[] = [];
  const read = readAttributes(ABSENT, (sentence) => warnings.push(sentence));
  assert.deepEqual(warnings, []);
  assert.equal(read.loading, 'lazy');
  assert.equal(credentialsOf(read.crossorigin), 'same-origin');
  assert.equal(read.touchAction, 'pan-y');
  assert.equal(read.interpolationDecay, 50);
  assert.equal(read.maxPixelRatio, Infinity);
  assert.equal(read.frameBudget, Infinity);
  assert.equal(read.quality, 'auto');
  assert.equal(read.maxShDegree, 3);
  assert.equal(read.detail, 'auto');
  assert.equal(read.camera.up, undefined, 'what the scene says');
  assert.deepEqual(read.camera.orbit, { theta: 'auto', phi: 'auto', radius: 'auto' });
});

test('a malformed attribute takes its default with one warning that says what was expected and found', () => {
  for (const [name, key] of Object.entries({
    'camera-orbit': 'cameraOrbit',
    'camera-target': 'cameraTarget',
    'field-of-view': 'fieldOfView',
    loading: 'loading',
    'touch-action': 'touchAction',
    up: 'up',
    'interpolation-decay': 'interpolationDecay',
    'max-pixel-ratio': 'maxPixelRatio',
    'frame-budget': 'frameBudget',
    quality: 'quality',
    renderer: 'renderer',
    'max-sh-degree': 'maxShDegree',
  })) {
    const warnings: string[] = [];
    const read = readAttributes({ ...ABSENT, [key]: 'nonsense' }, (sentence) => warnings.push(sentence));
    assert.equal(warnings.length, 1, name);
    assert.match(warnings[0], new RegExp(`<gaussian-splat> ${name}: expected .*, found "nonsense"; the default`));
    assert.deepEqual(
      read,
      readAttributes(ABSENT, () => undefined),
    );
  }
});

test('properties may hold numbers where attributes hold text', () => {
  const read = readAttributes({ ...ABSENT, interpolationDecay: 120, maxPixelRatio: 1.5, maxShDegree: 1 }, assert.fail);
  assert.equal(read.interpolationDecay, 120);
  assert.equal(read.maxPixelRatio, 1.5);
  assert.equal(read.maxShDegree, 1);
});

test('times are at most what timers can wait: longer ones would be over at once', () => {
  const read = readAttributes(
    { ...ABSENT, autoRotateDelay: Infinity, interactionPromptThreshold: '3e9', interpolationDecay: 7 },
    assert.fail,
  );
  const { autoRotateDelay, interactionPromptThreshold, interpolationDecay } = read;
  assert.deepEqual([autoRotateDelay, interactionPromptThreshold, interpolationDecay], [2 ** 31 - 1, 2 ** 31 - 1, 7]);
});

test('crossorigin is parsed as on <img>', () => {
  const credentials = (crossorigin: string): string =>
    credentialsOf(readAttributes({ ...ABSENT, crossorigin }, assert.fail).crossorigin);
  assert.deepEqual(['', 'anonymous', 'use-credentials'].map(credentials), ['same-origin', 'same-origin', 'include']);
});
