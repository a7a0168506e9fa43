/** Few numbers out of many. */

/** The quantile of samples for a fraction, 0..1; undefined without samples. */
export function quantile(values, share) {
  if (values.length === 0) return undefined;
  const sorted = [...values].sort((a, b) => a - b);
  return sorted[Math.min(sorted.length - 1, Math.max(0, Math.ceil(share * sorted.length) - 1))];
}

const rounded = (value) => (value === undefined ? undefined : Number(value.toFixed(4)));

/** Median and 95th percentile, in the unit of the values. */
export const summarize = (values) =>
  values.length === 0 ? undefined : { p50: rounded(quantile(values, 0.5)), p95: rounded(quantile(values, 0.95)) };

/** From the first pass's begin to the last one's end: passes may overlap, so their sum would say too much. */
export function spanOf(passes) {
  const valid = passes.filter(({ begin, end }) => end >= begin);
  if (valid.length === 0) return undefined;
  return Math.max(...valid.map(({ end }) => end)) - Math.min(...valid.map(({ begin }) => begin));
}

/** Median duration of all passes of each label in a frame, over frames. */
export function summarizeStages(frames) {
  const labels = [...new Set(frames.flatMap((passes) => passes.map(({ label }) => label)))];
  const total = (passes, label) =>
    passes
      .filter((pass) => pass.label === label && pass.end >= pass.begin)
      .reduce((sum, p) => sum + p.end - p.begin, 0);
  return Object.fromEntries(labels.map((label) => [label, summarize(frames.map((passes) => total(passes, label)))]));
}

/** Times as ratios to the standard's (see `visit`), medians over all bursts; undefined without a standard. */
function summarizeRatios(visits) {
  if (visits.every(({ ratios }) => ratios === undefined)) return undefined;
  const all = (name) => visits.flatMap(({ ratios }) => ratios?.[name] ?? []);
  return {
    burst: summarize(all('burst')),
    span: summarize(all('span')),
    wall: summarize(all('wall')),
    sortedWall: summarize(all('sortedWall')),
  };
}

/** Times of the standard over all visits to all subjects, as a separate result. */
export function summarizeStandard(results) {
  const all = (name) => results.flatMap(({ visits }) => visits.flatMap(({ standard }) => standard?.[name] ?? []));
  const spans = all('passes').map(spanOf);
  return {
    burst: summarize(all('bursts')),
    span: summarize(spans.filter((span) => span !== undefined)),
    wall: summarize(all('wall')),
  };
}

/** All samples of a configuration over all rounds; undefined where nothing was measured. */
export function summarizeVisits(visits) {
  const all = (name) => visits.flatMap((visit) => visit[name]);
  const frames = all('passes');
  const spans = frames.map(spanOf).filter((span) => span !== undefined);
  return {
    burst: summarize(all('bursts')),
    span: summarize(spans),
    stages: frames.length > 0 ? summarizeStages(frames) : undefined,
    wall: summarize(all('wall')),
    sortedWall: summarize(all('sortedWall')),
    empty: summarize(all('empty')),
    cpu: summarize(all('cpu')),
    ratio: summarizeRatios(visits),
    /** Medians of each round: how repeatable the figures are. */
    rounds: {
      burst: visits.map((visit) => rounded(quantile(visit.bursts, 0.5))),
      span: visits.map((visit) =>
        rounded(
          quantile(
            visit.passes.map(spanOf).filter((s) => s !== undefined),
            0.5,
          ),
        ),
      ),
      wall: visits.map((visit) => rounded(quantile(visit.wall, 0.5))),
    },
  };
}
