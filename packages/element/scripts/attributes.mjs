/**
 * Generates the attributes of the manifest and rows of documents from the tables in src/viewer/attributes.ts,
 * src/features/children/attributes.ts and src/features/effects/attributes.ts.
 */
import { readFileSync, writeFileSync } from 'node:fs';
import { fileURLToPath } from 'node:url';

const path = (name) => fileURLToPath(new URL(name, import.meta.url));
/** For each tag: the table of its attributes, and the document that has their rows. */
const TABLES = {
  'gaussian-splat': {
    table: 'ATTRIBUTES',
    document: path('../../../docs/guide/attributes.md'),
    rows: /(<!-- attributes: [^>]*-->\n)[^]*?(\n<!-- end -->)/,
  },
  'splat-scene': {
    table: 'SCENE_ATTRIBUTES',
    document: path('../../../docs/guide/scenes-and-meshes.md'),
    rows: /(<!-- attributes of splat-scene: [^>]*-->\n)[^]*?(\n<!-- end -->)/,
  },
  'splat-mesh': {
    table: 'MESH_ATTRIBUTES',
    document: path('../../../docs/guide/scenes-and-meshes.md'),
    rows: /(<!-- attributes of splat-mesh: [^>]*-->\n)[^]*?(\n<!-- end -->)/,
  },
  'splat-cut': {
    table: 'CUT_ATTRIBUTES',
    document: path('../../../docs/guide/effects.md'),
    rows: /(<!-- attributes of splat-cut: [^>]*-->\n)[^]*?(\n<!-- end -->)/,
  },
};

const kebab = (name) => name.replace(/[A-Z]/g, (letter) => `-${letter.toLowerCase()}`);

/** Types of a kind's property where no type argument says it. */
const TYPES = { flag: 'boolean', number: 'number | string | null' };

function typeOf(ts, { expression, typeArguments, arguments: [words] }) {
  const kind = expression.getText();
  if (/keyword$/i.test(kind)) return `${words.elements.map((word) => word.getText()).join(' | ')} | null`;
  return TYPES[kind] ?? typeArguments?.at(-1).getText() ?? 'string | null';
}

/** A plugin of the manifest's analyzer: adds each entry of a table to its element, as an attribute and as its property. */
export function tableOfAttributes() {
  const found = new Map();
  return {
    name: 'table-of-attributes',
    analyzePhase({ ts, node }) {
      if (!ts.isVariableDeclaration(node) || !node.initializer || !ts.isObjectLiteralExpression(node.initializer))
        return;
      if (!/^([A-Z_]*ATTRIBUTES|PLACED)$/.test(node.name.getText())) return;
      const entries = node.initializer.properties.flatMap((entry) => {
        // Common rows of several tables are listed once, in a table of their own.
        if (ts.isSpreadAssignment(entry)) return found.get(entry.expression.getText());
        const [{ comment, tags = [] }] = ts.getJSDocCommentsAndTags(entry).filter(ts.isJSDoc);
        const tagged = (wanted) => tags.find(({ tagName }) => tagName.text === wanted)?.comment;
        const [description, fallback, example] = [comment, tagged('default'), tagged('example')].map(
          ts.getTextOfJSDocComment,
        );
        const type = { text: typeOf(ts, entry.initializer) };
        return { name: entry.name.getText(), type, description, ...(fallback && { default: fallback }), example };
      });
      found.set(node.name.getText(), entries);
    },
    packageLinkPhase({ customElementsManifest: { modules } }) {
      for (const element of modules.flatMap(({ declarations = [] }) => declarations)) {
        const entries = found.get(TABLES[element.tagName]?.table);
        if (entries === undefined) continue;
        const names = new Set(entries.map(({ name }) => name));
        element.members = [
          ...entries.map((entry) => ({ kind: 'field', privacy: 'public', ...entry, attribute: kebab(entry.name) })),
          ...element.members.filter(({ name }) => !names.has(name)),
        ];
        // An attribute is text, even if its property accepts other types.
        const written = ({ text }) => ({ text: text.replace(' | readonly number[]', '') });
        element.attributes = entries.map((entry) => ({
          ...entry,
          name: kebab(entry.name),
          type: written(entry.type),
          fieldName: entry.name,
        }));
      }
    },
  };
}

/** The table of a document. */
export function attributeRows(attributes) {
  const row = ({ name, type, description, example, default: fallback = type.text === 'boolean' ? 'off' : '' }) =>
    `| \`${name}\` |${fallback && ` ${fallback}`} | ${description.replace(/\s*\n\s*/g, ' ')} |${example ? ` \`${example}\`` : ''} |`;
  return ['| attribute | default | meaning | example |', '|---|---|---|---|', ...attributes.map(row)].join('\n');
}

/** Brings the documents up to date. */
export function writeAttributeRows(manifest) {
  const declarations = manifest.modules.flatMap((module) => module.declarations);
  for (const [tag, { document, rows }] of Object.entries(TABLES)) {
    const { attributes } = declarations.find(({ tagName }) => tagName === tag);
    const before = readFileSync(document, 'utf8');
    const after = before.replace(rows, (_, begin, end) => `${begin}\n${attributeRows(attributes)}\n${end}`);
    if (after !== before) writeFileSync(document, after);
  }
}
