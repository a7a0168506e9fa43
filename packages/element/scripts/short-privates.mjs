/**
 * Private names in fewer bytes. Minifiers give each of them a short name of its own, as if all were of one class; here the first of every class is called the same, the second
 * of every class, and so on.
 */
import MagicString from 'magic-string';

/** Whatever a node is made of. */
const childrenOf = (node) =>
  Object.values(node)
    .flat()
    .filter((child) => typeof child?.type === 'string');

/** Private names with their places in the text: where they are declared, and where they are used. */
function* renamed(node, outer = new Map()) {
  let names = outer;
  if (node.type === 'ClassBody') {
    const declared = node.body.map(({ key }) => key).filter((key) => key?.type === 'PrivateIdentifier');
    // Those of a class around this one stay in sight. A getter and its setter have one name.
    const own = new Set(declared.map(({ name }) => name));
    names = new Map([...outer, ...[...own].map((name, i) => [name, `#p${outer.size + i}`])]);
  }
  if (node.type === 'PrivateIdentifier') yield { ...node, short: names.get(node.name) };
  for (const child of childrenOf(node)) yield* renamed(child, names);
}

/** A plugin for Rollup, before the minifier. */
export function shortPrivates() {
  return {
    name: 'short-privates',
    transform(code) {
      const text = new MagicString(code);
      for (const { start, end, short } of renamed(this.parse(code)))
        text.overwrite(start, end, short, { storeName: true });
      return text.hasChanged() ? { code: text.toString(), map: text.generateMap({ hires: 'boundary' }) } : null;
    },
  };
}
