/**
 * WGSL in fewer bytes that does the same: its own names become short ones, and spaces go that nothing needs. Pieces that are joined later are shortened together, so that a
 * name is the same in all of them.
 */

/** Words of the language that would be taken for names of ours where we declare the same. */
const WORDS = 'main storage uniform workgroup private function read write read_write'.split(' ');
/** Fields of vectors, and of what built-in functions return. */
const BUILT_IN_FIELD = /^([xyzw]{1,4}|[rgba]{1,4}|fract|exp|whole|old_value|exchanged)$/;
const DECLARATION = /\b(?:let|var(?:<[^>]*>)?|const|fn|alias|struct)\s+(\w+)/g;
/** A parameter, a field or a variable with its type; a case's selector is renamed where it is declared. */
const TYPED = /\b([A-Za-z_]\w*)\s*:/g;
const CALLED = /\b([A-Za-z_]\w*)\s*\(/g;
const NAME = /\b[A-Za-z_]\w*\b/g;

const firstsOf = (text, pattern) => [...text.matchAll(pattern)].map(([, name]) => name);

/** a to Z, then letters with a digit or a capital behind them: no word of the language is like that. */
function* shortNames() {
  const letters = [...'abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ'];
  yield* letters;
  for (const second of '0123456789ABCDEFGHIJKLMNOPQRSTUVWXYZ') for (const first of letters) yield first + second;
}

/** Names that must stay: of the language, of overridable constants, and those that only look like ours. */
function foreignIn(text) {
  const functions = new Set(firstsOf(text, /\b(?:fn|struct|alias)\s+(\w+)/g));
  return [
    ...WORDS,
    ...firstsOf(text, /\boverride\s+(\w+)/g),
    ...firstsOf(text, /@(\w+)/g),
    ...[...text.matchAll(/@(?:builtin|interpolate)\(([^)]*)\)/g)].flatMap(([, words]) => words.match(NAME)),
    ...firstsOf(text, /\.(\w+)/g).filter((field) => BUILT_IN_FIELD.test(field)),
    // A variable may have the name of a built-in function that is called elsewhere.
    ...firstsOf(text, CALLED).filter((name) => !functions.has(name)),
  ];
}

function renaming(text, kept) {
  const count = new Map();
  for (const [name] of text.matchAll(NAME)) count.set(name, (count.get(name) ?? 0) + 1);
  const foreign = new Set([...kept, ...foreignIn(text)]);
  const own = [...new Set([...firstsOf(text, DECLARATION), ...firstsOf(text, TYPED)])]
    .filter((name) => name.length > 2 && name !== 'default' && !foreign.has(name))
    .sort((a, b) => count.get(b) - count.get(a));
  const free = shortNames();
  return new Map(
    own.map((name) => {
      let short = free.next();
      while (count.has(short.value)) short = free.next();
      if (short.done) throw new Error(`no short name left for ${name}`);
      return [name, short.value];
    }),
  );
}

const isWord = (character) => /\w/.test(character);
const isOperator = (character) => /[-+*/%&|^<>=!~]/.test(character);
const needsSpace = (a, b) => (isWord(a) && isWord(b)) || (isOperator(a) && isOperator(b));

const withoutSpaces = (line) =>
  line.replace(/(?<=(\S))\s+(?=(\S))/g, (_, before, behind) => (needsSpace(before, behind) ? ' ' : ''));

/**
 * @param {Map<string, string>} pieces WGSL without comments, by any key
 * @param {{keptNames: readonly string[], keptLines: RegExp}} options names that stay, and lines whose spaces do: what replaces text looks for it
 * @returns {Map<string, string>} the same keys
 */
export function shortened(pieces, { keptNames, keptLines }) {
  const names = renaming([...pieces.values()].join('\n'), keptNames);
  const short = (line) => {
    const renamed = line.replace(NAME, (name) => names.get(name) ?? name);
    return keptLines.test(line) ? renamed : withoutSpaces(renamed);
  };
  return new Map([...pieces].map(([key, code]) => [key, code.split('\n').map(short).join('\n')]));
}
