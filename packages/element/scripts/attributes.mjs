/** What is made from the table in src/attributes.ts: the attributes of the manifest, and the rows of README.md. */
import { readFileSync, writeFileSync } from 'node:fs';
import { fileURLToPath } from 'node:url';

const README = fileURLToPath(new URL('../README.md', import.meta.url));
const ROWS = /(<!-- attributes[^>]*-->\n)[^]*?(\n<!-- end -->)/;

const kebab = (name) => name.replace(/[A-Z]/g, (letter) => `-${letter.toLowerCase()}`);

/** Types of a kind's property where no type argument says it. */
const TYPES = { flag: 'boolean', number: 'number | string | null' };

function typeOf(ts, { expression, typeArguments, arguments: [words] }) {
  const kind = expression.getText();
  if (/keyword$/i.test(kind)) return `${words.elements.map((word) => word.getText()).join(' | ')} | null`;
  return TYPES[kind] ?? typeArguments?.[0].getText() ?? 'string | null';
}

/** A plugin of the manifest's analyzer: adds each entry of the table to the element, as an attribute and as its property. */
export function tableOfAttributes() {
  let found = [];
  return {
    name: 'table-of-attributes',
    analyzePhase({ ts, node }) {
      if (!ts.isVariableDeclaration(node) || node.name.getText() !== 'ATTRIBUTES') return;
      found = node.initializer.properties.map((entry) => {
        const [{ comment, tags = [] }] = ts.getJSDocCommentsAndTags(entry).filter(ts.isJSDoc);
        const tag = tags.find(({ tagName }) => tagName.text === 'default');
        const [description, fallback] = [comment, tag?.comment].map(ts.getTextOfJSDocComment);
        const type = { text: typeOf(ts, entry.initializer) };
        return { name: entry.name.getText(), type, description, ...(fallback && { default: fallback }) };
      });
    },
    packageLinkPhase({ customElementsManifest: { modules } }) {
      const element = modules
        .flatMap(({ declarations = [] }) => declarations)
        .find(({ tagName }) => tagName === 'gaussian-splat');
      const names = new Set(found.map(({ name }) => name));
      element.members = [
        ...found.map((entry) => ({ kind: 'field', privacy: 'public', ...entry, attribute: kebab(entry.name) })),
        ...element.members.filter(({ name }) => !names.has(name)),
      ];
      element.attributes = found.map((entry) => ({ ...entry, name: kebab(entry.name), fieldName: entry.name }));
    },
  };
}

/** The table of README.md. */
export function attributeRows(attributes) {
  const row = ({ name, type, description, default: fallback = type.text === 'boolean' ? 'off' : '' }) =>
    `| \`${name}\` |${fallback && ` ${fallback}`} | ${description.replace(/\s*\n\s*/g, ' ')} |`;
  return ['| attribute | default | meaning |', '|---|---|---|', ...attributes.map(row)].join('\n');
}

/** Brings README.md up to date. */
export function writeAttributeRows(manifest) {
  const { attributes } = manifest.modules
    .flatMap(({ declarations }) => declarations)
    .find(({ tagName }) => tagName === 'gaussian-splat');
  const before = readFileSync(README, 'utf8');
  const after = before.replace(ROWS, (_, begin, end) => `${begin}\n${attributeRows(attributes)}\n${end}`);
  if (after !== before) writeFileSync(README, after);
}
