/** Words that the project's texts do without, and what stands in their place: one term for one thing. Code between backticks is never looked at. */

/** `[what is found, what to write]`. A pattern is as wide as the sense that is retired, and no wider. */
export const RETIRED = [
  [/\bpictures?\b/i, 'frame (drawn), image (a file), photo'],
  [/\b(true|truer|truest) (images?|frames?|colou?rs?)\b|\btruer\b|\b(as|how) true\b/i, 'accurate, reference image'],
  [/\bon show\b/i, 'visible, shown'],
  [/\b(is|are|was|were|be|been|being) told\b|\btold (of|by|apart)\b|\btold\b/i, 'reported, given'],
  [/\bof (yours|ours|theirs|mine)\b|\bof (one|its|their)('|’)s own\b|\bown-scene\b/i, 'your own, our'],
  [/\bwish(es|ed)?\b/i, 'page request; "visitors who ask for less motion"'],
  [/\b(is|are|was|were|be|been) looked( at)?\b|\blooked at\b/i, 'feedback, checked, read'],
  [/\bleavers?\b/i, 'eviction candidate'],
  [/\b(pace|paces|paced|rungs?|ladders?)\b/i, 'dynamic quality, quality level, rate'],
  [/\b(economy|economies|economi[sz](ed|es|ing)|spared)\b/i, 'prune, pruning, splat budget'],
  [/\bvisible sets?\b/i, 'potentially visible set (PVS)'],
  [/\blevers?\b/i, 'setting'],
  [/\bnoted\b|\bnot(es|ing) (contribution|depth|what)/i, 'auxiliary output'],
  [/\bthin(s|ned|ning)\b/i, 'filter'],
  [/\bgathered\b/i, 'depth range; collected'],
  [/\b(one|the|each|measured) choice of variants\b/i, 'autotune'],
  [/\bknown answers?\b/i, 'self-test'],
  [/\blive (generators?|models?|scenes?)\b/i, 'generator, dynamic'],
  [/\bpeople('s|’s)?\b/i, 'visitors, authors, callers'],
  [/\b(some|any|no|every)body('s|’s)?\b|\bwho(so)?ever\b|\bwhom\b/i, 'visitors, authors, callers; or the passive'],
  [/\bwhatever\b/i, 'name what: any, all, each'],
  [/\bso (many|much)\b/i, 'a number: n, as many as'],
  [/\bso (far|long)\b/i, 'until now, as long as, up to there'],
];

/** The first retired word of a text, if there is one: `{ found, instead, at }`. */
export function retiredIn(text) {
  const hits = RETIRED.flatMap(([pattern, instead]) =>
    [...text.matchAll(new RegExp(pattern.source, 'gi'))].map(({ 0: found, index: at }) => ({ found, instead, at })),
  );
  return hits.sort((a, b) => a.at - b.at);
}
