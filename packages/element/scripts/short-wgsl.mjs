/**
 * WGSL in fewer bytes that does the same: its own names become short ones, and spaces go that nothing needs. Pieces that are joined later are shortened together, so that a
 * name is the same in all of them. Names that never meet, as those in two functions, may become the same one.
 */

/** Words of the language that would be mistaken for our names if a shader declared the same name. */
const WORDS = 'main storage uniform workgroup private function read write read_write default'.split(' ');
/** Fields of vectors, and of what built-in functions return. */
const BUILT_IN_FIELD = /^\.([xyzw]{1,4}|[rgba]{1,4}|fract|exp|whole|old_value|exchanged)$/;
const DECLARATION = /\b(?:let|var(?:<[^>]*>)?|const|fn|alias|struct)\s+(\w+)/g;
/** A parameter, a field or a variable with its type; a case's selector is renamed where it is declared. */
const TYPED = /(\.?\b[A-Za-z_]\w*)\s*:/g;
const CALLED = /\b([A-Za-z_]\w*)\s*\(/g;
const ENTRY_POINT = /@(?:vertex|fragment|compute)\b[^{}]*?\bfn\s+(\w+)/g;
const STRUCT = /\bstruct\s+\w+\s*\{[^}]*\}/g;
/** A name, with its dot if it is a field's; or an attribute, whose words are the language's. */
const NAME = /@(?:builtin|interpolate)\([^)]*\)|@\w+|\.?\b[A-Za-z_]\w*\b/g;
/** Characters that are frequent in the language's own words come first, because they take the fewest bits. */
const LETTERS = [...'etanrisoldcufmphgvbwyxkjzqTSCEPADRIBMNLOFGVHUWXKYJZQ'];
/** Letters, then letters with a digit or a capital behind them: no word of the language is like that. */
const SHORT_NAMES = ['', ...'0123456789ABCDEFGHIJKLMNOPQRSTUVWXYZ'].flatMap((end) =>
  LETTERS.map((letter) => letter + end),
);

const firstsOf = (text, pattern) => [...text.matchAll(pattern)].map(([, name]) => name);
const namesIn = (text) => text.match(NAME).filter((name) => !name.startsWith('@'));

/** Fields have a dot where they are used. With one where they are declared, too, no other name is taken for theirs. */
const dotted = (text) => text.replace(STRUCT, (struct) => struct.replace(TYPED, '.$1:'));
const undotted = (text) => text.replace(TYPED, (declared) => declared.replace('.', ''));

/** Names that must stay: of the language, of entry points, of overridable constants, and those that only look like ours. */
function foreignIn(text) {
  const functions = new Set(firstsOf(text, /\b(?:fn|struct|alias)\s+(\w+)/g));
  return [
    ...WORDS,
    ...firstsOf(text, /\boverride\s+(\w+)/g),
    ...firstsOf(text, ENTRY_POINT),
    // A variable may have the name of a built-in function that is called elsewhere.
    ...firstsOf(text, CALLED).filter((name) => !functions.has(name)),
  ];
}

/** The text of each function, struct, constant and variable of a module. */
function declarationsIn(text) {
  const declarations = [];
  let depth = 0;
  let begin = 0;
  for (const { 0: mark, index } of text.matchAll(/[;{}]/g)) {
    if (mark === '{') depth++;
    if (mark === '}') depth--;
    if (depth > 0) continue;
    declarations.push(text.slice(begin, index + 1));
    begin = index + 1;
  }
  return declarations;
}

/** Sets of names that must not become one: those that the pieces of a shader declare, and those that meet in a declaration. */
function scopesOf(pieces, joined) {
  const declarations = new Map([...pieces].map(([key, text]) => [key, declarationsIn(text)]));
  const declared = (text) => firstsOf(text, DECLARATION).slice(0, 1);
  return [
    ...joined.map((keys) => new Set(keys.flatMap((key) => declarations.get(key).flatMap(declared)))),
    ...[...declarations.values()].flat().map((text) => new Set(namesIn(text))),
  ];
}

/** A short name for each, the most frequent first: the first one that no scope with the name has. */
function renaming(pieces, joined) {
  const text = [...pieces.values()].join('\n');
  const count = new Map();
  for (const name of namesIn(text)) count.set(name, (count.get(name) ?? 0) + 1);
  const foreign = new Set(foreignIn(text));
  const own = new Set(
    [...firstsOf(text, DECLARATION), ...firstsOf(text, TYPED)].filter(
      (name) => !foreign.has(name) && !BUILT_IN_FIELD.test(name),
    ),
  );
  const scopes = scopesOf(pieces, joined).map((names) => ({
    names,
    taken: new Set([...names].filter((name) => !own.has(name))),
  }));
  const renamed = new Map();
  for (const name of [...own].sort((a, b) => count.get(b) - count.get(a))) {
    const met = scopes.filter(({ names }) => names.has(name));
    const dot = name.startsWith('.') ? '.' : '';
    const letters = SHORT_NAMES.find((short) => !met.some(({ taken }) => taken.has(dot + short)));
    if (letters === undefined) throw new Error(`no short name left for ${name}`);
    const short = dot + letters;
    for (const { taken } of met) taken.add(short);
    renamed.set(name, short);
  }
  return renamed;
}

const isWord = (character) => /\w/.test(character);
const isOperator = (character) => /[-+*/%&|^<>=!~]/.test(character);
const needsSpace = (a, b) => (isWord(a) && isWord(b)) || (isOperator(a) && isOperator(b));

const withoutSpaces = (code) =>
  code.trim().replace(/(?<=(\S))\s+(?=(\S))/g, (_, before, behind) => (needsSpace(before, behind) ? ' ' : ''));

/**
 * @param {Map<string, string>} pieces WGSL without comments, by any key
 * @param {readonly (readonly string[])[]} joined the keys of each shader's pieces
 * @returns {Map<string, string>} the same keys
 */
export function shortened(pieces, joined) {
  const marked = new Map([...pieces].map(([key, code]) => [key, dotted(code)]));
  const names = renaming(marked, joined);
  const short = (code) => withoutSpaces(undotted(code.replace(NAME, (name) => names.get(name) ?? name)));
  return new Map([...marked].map(([key, code]) => [key, short(code)]));
}
