/** From samples to figures, from figures to the chart. */
import assert from 'node:assert/strict';
import { spawnSync } from 'node:child_process';
import { mkdtempSync, rmSync, writeFileSync } from 'node:fs';
import { tmpdir } from 'node:os';
import { join } from 'node:path';
import { test } from 'node:test';
import fc from 'fast-check';
import { benchModule, scriptModule } from './load.js';

interface Point {
  readonly ms: number;
  readonly psnr: number;
}

const { quantile, spanOf, summarizeStages, summarizeStandard, summarizeVisits } = await benchModule('run/summary.js');
const { parseObject, readConfigurations, readRun } = await benchModule('run/configuration.js');
const { watchOptions } = await benchModule('run/levers.js');
const { visit, visitInTurns } = await benchModule('run/measure.js');
const { compareImages } = await benchModule('quality/metrics.js');
const { nonDominated, hypervolume, passing, pointsOf } = await scriptModule('frontier/front.mjs');
const { configurations } = await scriptModule('frontier/configurations.mjs');
const { placeLabels } = await scriptModule('frontier/labels.mjs');
const { drawChart } = await scriptModule('frontier/chart.mjs');

const noJson = () => assert.fail('no JSON is loaded');

test('quantiles are samples, and the span is not the sum', () => {
  assert.equal(quantile([3, 1, 2], 0.5), 2);
  assert.equal(quantile([4, 1, 2, 3], 0.95), 4);
  assert.equal(quantile([], 0.5), undefined);
  const passes = [
    { label: 'a', begin: 1, end: 4 },
    { label: 'b', begin: 3, end: 6 },
    // Clocks of some GPUs run backwards now and then.
    { label: 'b', begin: 9, end: 8 },
  ];
  assert.equal(spanOf(passes), 5);
  assert.deepEqual(summarizeStages([passes]), { a: { p50: 3, p95: 3 }, b: { p50: 3, p95: 3 } });
  assert.equal(spanOf([]), undefined);
});

test('rounds are pooled, and their medians kept', () => {
  const visit = (...wall: number[]) => ({ passes: [], wall, sortedWall: [], cpu: wall, bursts: wall, empty: [] });
  const summary = summarizeVisits([visit(1, 2, 3), visit(5, 6, 7)]);
  assert.deepEqual(summary.wall, { p50: 3, p95: 7 });
  assert.deepEqual(summary.rounds.wall, [2, 6]);
  assert.equal(summary.span, undefined);
});

test('an address says what to measure', async () => {
  const query = new URLSearchParams(
    'n=1000&raster=tiles&options=depthKeyBits=16&pack={"sh":"int8"}&sizes=8x4,16x8&ladder=0.25,1',
  );
  const list = await readConfigurations(query, noJson);
  assert.deepEqual(
    list.map(({ splats, width }: { splats: number; width: number }) => [splats, width]),
    [
      [250_000, 8],
      [250_000, 16],
      [1_000_000, 8],
      [1_000_000, 16],
    ],
  );
  assert.deepEqual(list[0].options, { depthKeyBits: 16, rasterizer: 'tiles' });
  assert.deepEqual(list[0].pack, { sh: 'int8' });
  const listed = await readConfigurations(new URLSearchParams('list=a.json&options=depthKeyBits:16'), () => [
    { name: 'x', options: { rasterizer: 'tiles' } },
  ]);
  assert.deepEqual(listed[0].options, { depthKeyBits: 16, rasterizer: 'tiles' });
  assert.deepEqual(parseObject('a=1,b:true,c=word'), { a: 1, b: true, c: 'word' });
  assert.throws(() => parseObject('nonsense'), /expected key=value, found "nonsense"/);
  await assert.rejects(readConfigurations(new URLSearchParams('n=many'), noJson), /n: expected a number, found "many"/);
  assert.equal(readRun(new URLSearchParams('frames=7')).frames, 7);
});

test('an unknown option is reported', () => {
  const { options, unread } = watchOptions({ rasterizer: 'tiles', warp: 9 });
  assert.equal(options.rasterizer, 'tiles');
  assert.deepEqual(unread(), ['warp']);
});

test('subjects are visited forwards, then backwards; one that fails does not stop the others', async () => {
  const order: string[] = [];
  const entries = ['a', 'b', 'c'].map((name) => ({ name, cameras: [0, 1] }));
  const open = async ({ name }: { name: string }) => {
    order.push(name);
    if (name === 'b') throw new Error('no b');
    return { draw: () => {}, finish: async () => {}, facts: async () => ({}), close: () => {} };
  };
  const results = await visitInTurns(entries, { rounds: 2, open, warmUp: 1, busyMs: 0 });
  assert.deepEqual(order, ['a', 'b', 'c', 'c', 'a']);
  assert.match(results[1].error, /no b/);
  assert.equal(results[0].visits.length, 2);
  assert.equal(results[0].visits[0].wall.length, 2);
});

/** A subject whose frames each occupy the main thread for a number of milliseconds, on the test's clock. */
function subjectOf(millisecondsOf: (frame: number) => number, clock: { now: number }) {
  let frame = 0;
  return { draw: () => void (clock.now += millisecondsOf(frame++)), finish: async () => {} };
}

/** Runs with `performance.now` read from a clock that only subjects move on. */
async function onOwnClock<T>(run: (clock: { now: number }) => Promise<T>): Promise<T> {
  const clock = { now: 0 };
  const { now } = performance;
  performance.now = () => clock.now;
  try {
    return await run(clock);
  } finally {
    performance.now = now;
  }
}

test('beside a standard a clock that changes within the run changes nothing', async () => {
  const visits = await onOwnClock(async (clock) => {
    // Ever slower: from a frame to the one 800 frames later it takes twice the time.
    let drawn = 0;
    const slower = (milliseconds: number) => subjectOf(() => milliseconds * 2 ** (drawn++ / 800), clock);
    const cameras = Array.from({ length: 400 }, (_, i) => i);
    const how = { warmUp: 0, busyMs: 0, phases: ['burst'] };
    const standard = slower(2);
    assert.equal((await visit(slower(2), cameras, how)).ratios, undefined);
    const visits = [];
    for (const milliseconds of [2, 3]) visits.push(await visit(slower(milliseconds), cameras, { ...how, standard }));
    return visits;
  });
  const [same, slower] = visits.map((one) => summarizeVisits([one]));
  assert.ok(slower.burst.p50 > 2 * same.burst.p50, 'what the times alone say');
  assert.ok(Math.abs(same.ratio.burst.p50 - 1) < 0.01 && Math.abs(slower.ratio.burst.p50 - 1.5) < 0.01);
  const quality = { psnr: 60, worst: 1, ssim: 0.99 };
  // Subjects that omit splats count with the original scene.
  const bytes = { scene: 4000, renderer: 1000, perSplat: 1 };
  const results = [same, slower].map((one, i) => ({ ...one, quality, bytes, configuration: { name: `${i}` } }));
  const common = summarizeStandard(visits.map((one) => ({ visits: [one] })));
  const [a, b] = pointsOf({ results, standard: common, scene: { splats: 50 } });
  assert.equal(a.bytes, 100);
  assert.ok(Math.abs(b.ms / a.ms - 1.5) < 0.02, `${a.ms} and ${b.ms} ms`);
});

test('a setting that saves time in most frames and costs time in some is charged for both', async () => {
  const burstOf = (pays: number) =>
    onOwnClock(async (clock) => {
      const cameras = Array.from({ length: 80 }, (_, i) => i);
      const standard = subjectOf(() => 2, clock);
      const how = { warmUp: 0, busyMs: 0, phases: ['burst'], standard };
      return summarizeVisits([
        await visit(
          subjectOf((frame) => (frame % 10 === 7 ? pays : 1), clock),
          cameras,
          how,
        ),
      ]);
    });
  assert.equal((await burstOf(11)).ratio.burst.p50, 1);
  assert.equal((await burstOf(21)).ratio.burst.p50, 1.5);
});

test('a line is exceeded by results that are as fast, as accurate and as small, and clearly better in one of these', () => {
  const line = { name: 'line', ms: 2, psnr: 60, bytes: 100 };
  const others = [
    { name: 'twin', ms: 1.99, psnr: 60.01, bytes: 100 },
    { name: 'larger', ms: 1, psnr: 70, bytes: 101 },
    { name: 'truer', ms: 2, psnr: 61, bytes: 100 },
    { name: 'smaller', ms: 2, psnr: 60, bytes: 99 },
    { name: 'slower', ms: 3, psnr: 90, bytes: 1 },
    { name: 'stranger', ms: 1, psnr: 60 },
  ];
  assert.deepEqual(
    passing(line, [line, ...others]).map(({ name }: { name: string }) => name),
    ['truer', 'smaller', 'stranger'],
  );
});

test('images are compared as a display shows them, where anything is seen', () => {
  const [width, height] = [16, 12];
  const covered = Uint8Array.from({ length: width * height }, (_, i) => (i < 96 ? 1 : 0));
  const color = Float32Array.from({ length: 3 * width * height }, (_, i) => (i < 288 ? (i % 7) / 8 : 0));
  const pixels = new Float32Array(4 * width * height);
  for (let i = 0; i < width * height; i++) for (let k = 0; k < 3; k++) pixels[4 * i + k] = color[3 * i + k];
  const size = { width, height };
  assert.equal(compareImages(pixels, { color, covered }, size).psnr, 150);
  const middle = 3 * width + 8;
  pixels[4 * middle] = color[3 * middle] + 0.1;
  const off = compareImages(pixels, { color, covered }, size);
  assert.ok(Math.abs(off.psnr - -10 * Math.log10(0.01 / 288)) < 0.01, `${off.psnr} dB`);
  assert.ok(off.psnrAll > off.psnr);
  assert.equal(off.worst, 25.5);
  assert.ok(off.ssim < 1);
  // Brighter than white is white.
  const bright = { color: color.map((value) => 1 + value), covered };
  const other = new Float32Array(pixels.length).fill(3);
  assert.equal(compareImages(other, bright, size).psnr, 150);
});

test('the front is what nothing dominates', () => {
  const point = fc.record({ ms: fc.integer({ min: 1, max: 20 }), psnr: fc.integer({ min: 30, max: 50 }) });
  fc.assert(
    fc.property(fc.array(point, { minLength: 1, maxLength: 12 }), (points) => {
      const front: Point[] = nonDominated(points);
      assert.ok(front.length > 0);
      for (const p of points) {
        const beaten = front.some((f) => f.ms <= p.ms && f.psnr >= p.psnr);
        assert.ok(beaten, 'every point is on the front or behind it');
      }
      for (let i = 1; i < front.length; i++)
        assert.ok(front[i].ms >= front[i - 1].ms && front[i].psnr >= front[i - 1].psnr);
    }),
  );
  assert.equal(hypervolume([{ ms: 20, psnr: 80 }]), 0);
  assert.ok(Math.abs(hypervolume([{ ms: 1.66, psnr: 46 }]) - 10) < 1e-9);
  assert.equal(
    hypervolume([{ ms: 1.66, psnr: 46 }]),
    hypervolume([
      { ms: 1.66, psnr: 46 },
      { ms: 2, psnr: 40 },
    ]),
  );
});

test('the chart names every configuration that worked and no other', () => {
  const names = new Set(configurations.map(({ name }: { name: string }) => name));
  assert.equal(names.size, configurations.length, 'names are unique');
  const quality = { psnr: 60, worst: 1, ssim: 0.99 };
  const result = (name: string, p50: number, tier: string) => ({
    ...{ configuration: { name, tier }, quality },
    burst: { p50, p95: p50 },
  });
  const report = {
    environment: {
      adapter: { description: 'A <GPU> & more' },
      versions: { commit: 'abc', playcanvas: '1', spark: '2' },
      date: '2026-01-01T00:00:00Z',
      userAgent: 'HeadlessChrome/1.2',
    },
    scene: { scene: 'a/skull.spz', splats: 5, width: 4, height: 3, views: 2, path: 'orbit', antialiased: false },
    reference: { kind: 'oracle' },
    run: { rounds: 1, frames: 1 },
    results: [
      result('one', 1, 'tier'),
      result('two', 10, 'setting'),
      { configuration: { name: 'broken' }, error: 'no' },
    ],
  };
  const svg: string = drawChart(report);
  assert.match(svg, /^<svg xmlns="http:\/\/www.w3.org\/2000\/svg"/);
  assert.match(svg, />one<\/text>/);
  assert.match(svg, />two<\/text>/);
  assert.doesNotMatch(svg, /broken/);
  assert.match(svg, /A &lt;GPU&gt; &amp; more/);
  assert.doesNotMatch(svg, /NaN|undefined/);
  assert.match(svg, /prefers-color-scheme: dark/);
  const small: string = drawChart(report, 'small');
  assert.match(small, /viewBox="0 0 460 /);
  assert.match(small, />one<\/text>/);
  assert.doesNotMatch(small, />two<\/text>/, 'settings have no names there');
});

test('points that lie on one another share a label, and no label covers another', () => {
  const names = ['default', 'tiles', 'a', 'b', 'c', 'd'];
  const points = [
    ...names.map((text, i) => ({ x: 100 + 0.5 * i, y: 100, text, weight: i === 0 ? 1 : 0 })),
    ...Array.from({ length: 12 }, (_, i) => ({ x: 90 + 3 * (i % 5), y: 130 + 9 * i, text: `lever ${i}`, weight: 0 })),
  ];
  const placed = placeLabels(points, { left: 0, right: 600, top: 0, bottom: 400, font: 12 });
  assert.equal(placed.length, 13);
  assert.equal(placed[0].text, 'default, tiles, a and 3 more');
  const boxes = (placed as { box: { x: number; y: number; width: number; height: number } }[]).map(({ box }) => box);
  for (const [i, a] of boxes.entries())
    for (const b of boxes.slice(i + 1))
      assert.ok(a.x >= b.x + b.width || b.x >= a.x + a.width || a.y >= b.y + b.height || b.y >= a.y + a.height);
});

test('a report with images from another machine requires a Python that measures LPIPS', () => {
  const folder = mkdtempSync(join(tmpdir(), 'frontier-'));
  try {
    const report = join(folder, 'report.json');
    writeFileSync(report, JSON.stringify({ kind: 'frontier', reference: { images: ['data:,'] }, results: [] }));
    const { status, stderr } = spawnSync(
      process.execPath,
      ['scripts/frontier/run-frontier.mjs', '--from', report, '--out', folder],
      { encoding: 'utf8' },
    );
    assert.equal(status, 1);
    assert.match(stderr, /--python: expected a Python that measures LPIPS/);
  } finally {
    rmSync(folder, { recursive: true });
  }
});

test('the build of a configuration is read from the address and the list', async () => {
  const [one] = await readConfigurations(new URLSearchParams('peer=ours&build=/other/bench/'), noJson);
  assert.deepEqual([one.peer, one.build], ['ours', '/other/bench/']);
  const list = JSON.stringify([{ peer: 'ours' }, { peer: 'ours', build: '/other/bench/' }]);
  const both = await readConfigurations(new URLSearchParams({ list }), noJson);
  assert.deepEqual(
    both.map(({ build }: { build: string }) => build),
    ['', '/other/bench/'],
  );
});
