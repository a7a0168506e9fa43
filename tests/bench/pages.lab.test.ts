/** The built pages in Chromium: small runs of our renderer beside another. Needs `npm run build`, which `npm test` does. */
import assert from 'node:assert/strict';
import { test } from 'node:test';
import { onlyInFull } from '../support/extent.js';
import { scriptModule } from './load.js';

const { runPage } = await scriptModule('lib/browser-page.mjs');
const { pointsOf } = await scriptModule('frontier/front.mjs');

const SMALL = { frames: '2', rounds: '2', warmup: '1' };

test('the benchmark page measures a list in one report', { timeout: 180_000 }, async () => {
  const list = JSON.stringify([
    { name: 'ours' },
    {
      ...{ name: 'half', resolutionScale: 0.5, pack: { sh: 'int8', gloss: 1 } },
      options: { rasterizer: 'tiles', depthKeyBits: 16, warp: 9 },
    },
    { name: 'PlayCanvas', peer: 'playcanvas' },
    { name: 'the same build', peer: 'ours', build: './' },
  ]);
  const report = await runPage('bench/index.html', { ...SMALL, list, n: '2000', w: '96', h: '64' });
  assert.deepEqual(report.errors, []);
  assert.equal(report.results.length, 4);
  const [ours, half, playcanvas, same] = report.results;
  for (const { configuration, wall, cpu, burst, error } of report.results) {
    assert.equal(error, undefined);
    assert.equal(configuration.splats, 2000);
    for (const { p50 } of [wall, cpu, burst]) assert.ok(p50 > 0, `${configuration.name} took time`);
  }
  assert.ok(ours.statistics.visible > 100 && ours.statistics.visible <= 2000);
  assert.ok(ours.bytes.perSplat > 100);
  assert.deepEqual(half.ignoredOptions, ['warp', 'gloss']);
  assert.equal(half.rasterizer, 'tiles');
  assert.deepEqual(same.errors, []);
  assert.deepEqual(same.versions, report.environment.versions);
  assert.equal(same.statistics.visible, ours.statistics.visible, 'the same splats in a frame of its own');
  if (report.environment.timestamps) {
    assert.ok(ours.span.p50 > 0 && playcanvas.span.p50 > 0);
    assert.ok('compose' in half.stages && 'rasterize' in ours.stages);
    assert.ok(ours.span.p50 <= ours.wall.p95, 'the GPU is not busy for longer than the time limit');
  }
  await assert.rejects(runPage('bench/index.html', { ...SMALL, paths: 'nowhere' }), /path: expected orbit/);
});

test('what hangs overhead is not visible', { timeout: 180_000, skip: onlyInFull }, async () => {
  const common = { ...SMALL, rounds: '1', w: '96', h: '64', phases: 'wall' };
  const overhead = { ...common, layout: 'overhead', visible: '5000' };
  // Both have several copies: a single scene is not cut to whole chunks.
  const few = await runPage('bench/index.html', { ...overhead, n: '90000' });
  const many = await runPage('bench/index.html', { ...overhead, n: '200000' });
  assert.equal(many.results[0].configuration.splats, 200_000);
  assert.equal(many.results[0].statistics.visible, few.results[0].statistics.visible);
});

test('the frontier page compares with the oracle', { timeout: 180_000 }, async () => {
  const query = { ...SMALL, rounds: '1', n: '20000', w: '192', h: '128', distance: '0.5', views: '2' };
  const report = await runPage('bench/frontier.html', { ...query, only: '^(default|balanced at 0.5)$' });
  assert.deepEqual(report.errors, []);
  assert.equal(report.reference.kind, 'oracle');
  const [full, half] = report.results;
  assert.equal(full.views.length, 2);
  assert.ok(full.quality.psnr >= 59, `default: ${full.quality.psnr} dB`);
  assert.ok(half.quality.psnr < full.quality.psnr - 10, `half: ${half.quality.psnr} dB`);
  assert.equal(pointsOf(report).length, 2);
});

test(
  'the page of first frames: a first visit, the variants chosen after it, and a later one',
  { timeout: 180_000 },
  async () => {
    const report = await runPage('bench/start.html', { visits: '2', width: '64', height: '48' });
    assert.equal(report.error, undefined);
    const [first, later] = report.visits;
    for (const { shownMs } of report.visits) assert.ok(shownMs > 0 && shownMs < 60_000, `${shownMs} ms`);
    assert.ok(first.chosenMs >= 0, 'the choice is made while the page is open');
    assert.ok(first.testMs > 0, `the self-test took ${first.testMs} ms`);
    assert.equal(later.chosenMs, undefined);
    assert.equal(report.chosen.length, 1, 'what an earlier visit found is kept');
    await assert.rejects(runPage('bench/start.html', { visits: '0' }), /visits: expected a whole number/);
  },
);

test(
  'the page of frames in motion: real elements, a step, its figures and the accurate frame',
  { timeout: 180_000 },
  async () => {
    const query = {
      n: '300',
      width: '64',
      height: '48',
      seconds: '1.3',
      before: '0.2',
      attributes: '{"detail":"off"}',
    };
    const report = await runPage('bench/pace.html', { ...query, steps: 'elements:2' });
    assert.equal(report.error, undefined);
    const [{ elements, target, span, interval, timed, restMs, wholeMs, levels }] = report.steps;
    assert.equal(elements, 2);
    // Two subjects divide the display's time for one: 0.8 of an interval of 60 Hz or less, which is measured.
    assert.ok(target > 0 && target <= (1.02 * 0.8 * 1000) / 60 / 2, `${target} ms`);
    assert.ok(timed > 0 && span.p95 >= span.p50 && span.p50 > 0, JSON.stringify(span));
    assert.ok(interval.p50 > 0 && wholeMs > 0 && restMs >= 0);
    assert.ok(levels.length > 0 && levels[0].at < 200);

    // A budget limits the time of the whole image, with any other work on the display.
    const budgeted = await runPage('bench/pace.html', { ...query, budget: '40', compare: '0', steps: 'elements:2' });
    assert.equal(budgeted.error, undefined);
    const [step] = budgeted.steps;
    assert.ok(step.target > 2 * target && step.load < 0.5, `${step.load} of ${step.target} ms`);
    assert.ok(
      step.levels.every(({ level }: { level: string }) => level === 'whole'),
      JSON.stringify(step.levels),
    );
  },
);

test('the page of several scenes: as one, as two, as ten, moved, added, reordered', { timeout: 180_000 }, async () => {
  const query = { n: '20000', width: '48', height: '32', frames: '2', rounds: '1', warmup: '1' };
  const report = await runPage('bench/world.html', { ...query, options: '{"shDegree":0}' });
  assert.equal(report.error, undefined);
  assert.deepEqual(report.errors, []);
  for (const { name, ratio, burst, facts } of report.results) {
    assert.ok(ratio.burst.p50 > 0 && burst.p50 > 0, name);
    // A contact shadow is made of splats.
    const hasShadow = /shadow/.test(name);
    const added = facts.own.splats - facts.standard.splats;
    assert.ok(hasShadow ? added > 0 : added === 0, `${name}: ${added} splats more`);
    const isStill = !hasShadow && !/moved|moves|faded/.test(name);
    if (isStill)
      assert.equal(facts.own.statistics.visible, facts.standard.statistics.visible, `${name}: as many visible`);
  }
  const [two, ten, moved] = report.results;
  assert.deepEqual(
    [two, ten, moved].map(({ facts }) => facts.own.scenes),
    [2, 10, 10],
  );
  assert.ok(report.changes.alone > 0);
  for (const { name, grown, allocated, allocatedAfter } of report.changes.rows) {
    assert.equal(allocatedAfter.buffers, 0, `${name}: the frames after it allocate nothing`);
    if (name.startsWith('one is added')) assert.ok(grown <= report.changes.alone, `${name}: ${grown} bytes`);
    // The list of pages is written again: some bytes for each scene.
    if (name.startsWith('all')) assert.ok(grown === 0 && allocated.bytes < 1024, `${name}: ${allocated.bytes} bytes`);
  }
});
