/** Words that the project's texts do without, and what stands in their place: one term for one thing. Code between backticks is ignored. */

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
  [/(?<!potentially )\bvisible sets?\b/i, 'potentially visible set (PVS)'],
  [/\blevers?\b/i, 'setting'],
  [/\bnoted\b|\bnot(es|ing) (contribution|depth|what)/i, 'auxiliary output'],
  [/\bthin(s|ned|ning)\b/i, 'filter'],
  [/\bgathered\b/i, 'depth range; collected'],
  [/\b(one|the|each|measured) choice of variants\b/i, 'autotune'],
  [/\bknown answers?\b/i, 'self-test'],
  [/\blive (generators?|models?|scenes?)\b/i, 'generator, dynamic'],
  [
    /(?<!\.)\b(some|any|no|every)body('s|’s)?\b|\bwho(so)?ever\b|\bwhom\b/i,
    'visitors, authors, callers; or the passive',
  ],
  [/\bwhatever\b/i, 'name what: any, all, each'],
  [/\bso (many|much)\b/i, 'a number: n, as many as'],
  [/\bso (far|long)\b/i, 'until now, as long as, up to there'],
  [/\b(gives?|gave|given|giving) way\b/i, 'is replaced by, is dismissed'],
  [/\b(in|into|out of) sight\b/i, 'visible, in the viewport, off-screen'],
  [/\bsets? out\b/i, 'starts moving to'],
  [/\btell(s|ing)?\b(?! (the|vue|react|typescript)('s)? compiler)/i, 'reports, shows, distinguishes'],
  [
    /\b(each|every|last|next|two|one|no|between|makes?) looks?\b|\blooks? (into|back|ahead)\b/i,
    'feedback pass, read-back, sample',
  ],
  [/\b[Aa]s of\b(?= (`|<|the (last|first)|those|all|HTML|a ))/, 'same as on; since'],
  [/\b(a|an|the|this|that|no|each|its|least|most) shares?\b|\bshares? of\b/i, 'fraction, ratio, percentage; shard'],
  [/\banew\b/i, 'again'],
  [/\blikewise\b/i, 'also; the same'],
  [/\bby (itself|themselves)\b/i, 'automatically, on its own'],
  [/\bmend(s|ed|ing)?\b/i, 'fix, recover'],
  [/\bsome (?=\d|tenths|ten |half a|few )/i, 'about'],
  [/\bbut for\b/i, 'except for'],
  [/\b(is|are|was|were|be) begun\b/i, 'starts'],
  [/\bsees? to\b/i, 'manages, ensures'],
  [/\bhears?\b/i, 'is called with'],
  [/\bin disguise\b/i, 'software adapter'],
  [/\b(page['’]s (own )?thread|thread of (the|a) page)\b/i, 'main thread'],
  [/(?<!post-)\bprocessors?\b/i, 'CPU; a post-processor is exempt'],
  [/\bmade (scenes?|splats?|ones)\b/i, 'synthetic'],
  [/\btrue ones?\b/i, 'reference'],
  [/\bdB (or more )?(from|of|nearer|away)\b/i, 'dB PSNR (against the reference)'],
  [/\bnumbers of (the )?([a-z]+ )?(splats|survivors)\b/i, 'indices'],
  [/\bcome of (it|them|two|one)\b|\bwhat (comes|came) of\b/i, 'result'],
  [
    /\b(is|are|was|were) there\b(?=[.,;:)]| (already|yet|now|when|once|before|until|at once|by))/i,
    'available, loaded, resident',
  ],
  [/\bgo(es)? (along|on)\b(?! (a|the|one|any)\b)/i, 'continue'],
  [/\bat hand\b/i, 'available, present'],
  [/\bin the mean\b/i, 'on average'],
  [/\bstrangers\b/i, 'untrusted'],
  [/\bpersons\b/i, 'people'],
  [/\b(Most|Least|Fewest) (?=[a-z]+s? (that|of|at|a|in)\b)/, 'maximum, minimum'],
  [
    /(^|[.:] )What (?=(is|was|are|has|have|it|they|a|an|the|comes|lies|stays|else|changes|moves|follows)\b)/m,
    'begin with the noun or the verb',
  ],
];

/** Words that are right at times: upper limits of their number per 1,000 words. */
export const RATES = {
  where: /\bwhere\b/gi,
  'what-clauses':
    /\bwhat (is|was|are|were|has|have|had|it|they|a|an|the|comes|came|lies|stays|else|changes|moves|follows|holds|needs|would|others)\b/gi,
  'of which': /\b(of|by|in|for|to|at|from|between) which\b/gi,
};

/** The last pattern is not for headings: these, and the label of a link, may begin with What. */
const EVERYWHERE = RETIRED.map(([pattern, instead]) => [new RegExp(pattern.source, `g${pattern.flags}`), instead]);

/** Retired words of a text in their order: `{ found, instead, at }`. */
export function retiredIn(text, { isHeading = false } = {}) {
  const patterns = isHeading ? EVERYWHERE.slice(0, -1) : EVERYWHERE;
  const hits = patterns.flatMap(([pattern, instead]) =>
    [...text.matchAll(pattern)].map(({ 0: found, index: at }) => ({ found, instead, at })),
  );
  return hits.sort((a, b) => a.at - b.at);
}
