/** Frames in motion: from an address to steps, from frames to figures. */
import assert from 'node:assert/strict';
import { test } from 'node:test';
import { benchModule } from './load.js';

const { decibels, figuresOf, levelsOf, pixelsFor, reversals, summarize } = await benchModule('pace/figures.js');
const { parseSteps, readPlan } = await benchModule('pace/plan.js');

const NAMES = ['whole', 'balanced', 'fast'];

/** A frame of the display every 10 ms. */
const frame = (k: number, moving: string, span: number | null) => ({
  at: 10 * k,
  interval: 10,
  moving,
  target: 8,
  span,
});

test('steps are named changes with a number, and an address is checked', () => {
  assert.deepEqual(parseSteps('distance:0.6,burn:0'), [
    { what: 'distance', value: 0.6 },
    { what: 'burn', value: 0 },
  ]);
  for (const wrong of ['near', 'size:', 'size:0', 'speed:2', 'load:x'])
    assert.throws(() => parseSteps(wrong), /steps: expected distance, size/);
  const plan = readPlan(new URLSearchParams('n=5000&steps=load:2&compare=0'));
  assert.deepEqual([plan.splats, plan.steps.length, plan.compares], [5000, 1, false]);
  assert.throws(() => readPlan(new URLSearchParams('width=wide')), /width: expected a number, found "wide"/);
});

test('reversals are changes of direction: to and fro is one, there and on is none', () => {
  assert.equal(reversals([0, 0, 2, 2, 3]), 0);
  assert.equal(reversals([0, 2, 2, 1]), 1);
  assert.equal(reversals([0, 2, 1, 2, 2, 1]), 3);
});

test('spans count from a second after the step on, levels until five', () => {
  const frames = Array.from({ length: 600 }, (_, k) => {
    if (k < 50) return frame(k, 'whole', 24);
    return k < 550 ? frame(k, 'fast', k % 2 ? 4 : null) : frame(k, 'balanced', 6);
  });
  const figures = figuresOf(frames, NAMES);
  assert.deepEqual(levelsOf(frames), [
    { at: 0, level: 'whole' },
    { at: 500, level: 'fast' },
    { at: 5500, level: 'balanced' },
  ]);
  assert.equal(figures.reversals, 0, 'the climb came after five seconds');
  assert.deepEqual(figures.span, { p50: 0.5, p95: 0.75 });
  assert.equal(figures.target, 8);
  const other = { ...figures, span: { p50: 0.25, p95: 0.875 }, reversals: 1, timed: 3 };
  const all = summarize([figures, other], frames);
  assert.deepEqual([all.span.p95, all.reversals, all.timed, all.interval.p95], [0.875, 1, 3, 10]);
});

test('images: identical, empty, or a PSNR if either shows something', () => {
  const [black, gray] = [Uint8Array.of(0, 0, 0, 255, 0, 0, 0, 255), Uint8Array.of(10, 10, 10, 255, 0, 0, 0, 255)];
  assert.equal(decibels(gray, gray), 'identical');
  assert.equal(decibels(black, black), 'empty');
  assert.equal(decibels(black, gray), Number((20 * Math.log10(25.5)).toFixed(3)));
});

test('a size for a time: along the line through two that are known, and no further than may be', () => {
  const known = [
    { pixels: 1000, milliseconds: 2 },
    { pixels: 2000, milliseconds: 3 },
  ];
  assert.equal(pixelsFor(41, known, 1e6), 40_000);
  assert.equal(pixelsFor(60, known, 2e4), 2e4);
  assert.equal(pixelsFor(0.1, known, 1e6), 128 ** 2);
  const flat = known.map(({ pixels }) => ({ pixels, milliseconds: 2 }));
  assert.equal(pixelsFor(6, flat, 1e6), 1e6);
});
