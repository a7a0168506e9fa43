/** The benchmark page: measures every configuration that its address asks for (run/configuration.js), in one report. */
import { camerasAlong } from './scene/paths.js';
import { showError, showProgress, showResults } from './page/show.js';
import { readConfigurations, readRun } from './run/configuration.js';
import { describeEnvironment, openDevice } from './run/environment.js';
import { visitInTurns } from './run/measure.js';
import { sendReport } from './run/report.js';
import { BenchScene, sceneKey } from './run/scenes.js';
import { Subjects } from './run/subjects.js';
import { summarizeVisits } from './run/summary.js';

/** Configurations of one scene are measured in turns; scenes follow one another, so that one is in memory at a time. */
async function measureScene(gpu, configurations, run) {
  showProgress(`loading ${configurations[0].scene}`);
  const scene = await BenchScene.load(gpu.device, configurations[0]);
  const subjects = new Subjects(gpu.device, scene);
  const entries = configurations.map((configuration) => ({
    ...configuration,
    cameras: camerasAlong({ ...configuration, frames: run.frames, radius: scene.radius * configuration.distance }),
  }));
  try {
    const results = await visitInTurns(entries, {
      ...run,
      open: (entry) => subjects.open(entry),
      onVisit: ({ name }, round) => showProgress(`${scene.count} splats, round ${round + 1} of ${run.rounds}: ${name}`),
    });
    return results.map(({ visits, facts, error }, i) => ({
      configuration: { ...configurations[i], splats: scene.count },
      ...(error ? { error } : { ...summarizeVisits(visits), ...facts }),
    }));
  } finally {
    subjects.dispose();
    await scene.destroy();
  }
}

async function measureAll(configurations, run) {
  const gpu = await openDevice();
  const scenes = Map.groupBy(configurations, sceneKey);
  const results = [];
  for (const ofScene of scenes.values()) {
    try {
      results.push(...(await measureScene(gpu, ofScene, run)));
    } catch (error) {
      // One scene too large for this device must not cost the figures of the others.
      results.push(...ofScene.map((configuration) => ({ configuration, error: String(error.stack ?? error) })));
    }
    showResults(results);
  }
  return { kind: 'benchmark', environment: describeEnvironment(gpu), run, results, errors: gpu.errors };
}

async function main() {
  const query = new URLSearchParams(location.search);
  if (location.search.length < 2) return;
  const run = readRun(query);
  let report;
  try {
    const configurations = await readConfigurations(query, async (url) => (await fetch(url)).json());
    report = await measureAll(configurations, run);
    showResults(report.results, report);
  } catch (error) {
    report = { kind: 'benchmark', run, error: String(error.stack ?? error) };
    showError(error);
  }
  await sendReport(report, run.report);
}

await main();
