/**
 * Generates the attributes of the manifest and rows of documents from the tables in src/viewer/attributes.ts and
 * src/viewer/element-attributes.ts, in src/features/children/attributes.ts and src/features/effects/attributes.ts, and in the rows of features
 * (src/features/NAME/row.ts). A row also adds slots, parts, custom properties and events: the tags of its comment.
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

const isRow = (path) => /features\/[^/]+\/row\.ts$/.test(path);

/** @param navigations Kinds of camera motion that features add to the attribute `navigation`. */
function typeOf(ts, { expression, typeArguments, arguments: [words] }, navigations) {
  const kind = expression.getText();
  if (/keyword$/i.test(kind)) {
    const named = words.elements.flatMap((word) => (ts.isSpreadElement(word) ? navigations : [word.getText()]));
    return `${named.join(' | ')} | null`;
  }
  return TYPES[kind] ?? typeArguments?.at(-1).getText() ?? 'string | null';
}

/**
 * A plugin of the manifest's analyzer: adds each entry of a table to its element, as an attribute and as its property. The analyzer visits files in any order, so that all is
 * read at the end, by path.
 */
export function tableOfAttributes() {
  const nodes = [];
  return {
    name: 'table-of-attributes',
    analyzePhase({ ts, node, moduleDoc: { path } }) {
      const isTable =
        ts.isVariableDeclaration(node) &&
        node.initializer &&
        ts.isObjectLiteralExpression(node.initializer) &&
        /^([A-Z_]*ATTRIBUTES|PLACED)$/.test(node.name.getText());
      const isMode = isRow(path) && ts.isPropertyAssignment(node) && node.name.getText() === 'navigation';
      const isTagged = isRow(path) && ts.isVariableStatement(node);
      if (isTable || isMode || isTagged) nodes.push({ ts, node, path, isTable, isMode, isTagged });
    },
    packageLinkPhase({ customElementsManifest: { modules } }) {
      const { found, ofFeatures } = readAll(nodes.sort((a, b) => (a.path < b.path ? -1 : a.path > b.path ? 1 : 0)));
      for (const element of modules.flatMap(({ declarations = [] }) => declarations)) {
        const own = found.get(TABLES[element.tagName]?.table);
        if (own === undefined) continue;
        const isMain = element.tagName === 'gaussian-splat';
        const entries = isMain ? [...own, ...ofFeatures.attributes] : own;
        if (isMain)
          for (const kind of ['slots', 'cssParts', 'cssProperties', 'events'])
            element[kind] = [...(element[kind] ?? []), ...ofFeatures[kind]];
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

/** Returns the entries of all tables by name, and the attributes and documented additions of all features. */
function readAll(nodes) {
  const navigations = nodes.filter(({ isMode }) => isMode).map(({ node }) => node.initializer.getText());
  const tables = nodes.filter(({ isTable }) => isTable);
  const found = new Map(tables.map(({ node }) => [node.name.getText(), undefined]));
  const entriesOf = (name) => {
    const { ts, node } = tables.find(({ node }) => node.name.getText() === name);
    return node.initializer.properties.flatMap((entry) => {
      // Common rows of several tables are listed once, in a table of their own.
      if (ts.isSpreadAssignment(entry))
        return found.has(entry.expression.getText()) ? entriesOf(entry.expression.getText()) : [];
      const [{ comment, tags = [] }] = ts.getJSDocCommentsAndTags(entry).filter(ts.isJSDoc);
      const tagged = (wanted) => tags.find(({ tagName }) => tagName.text === wanted)?.comment;
      const [description, fallback, example] = [comment, tagged('default'), tagged('example')].map(
        ts.getTextOfJSDocComment,
      );
      const type = { text: typeOf(ts, entry.initializer, navigations) };
      return { name: entry.name.getText(), type, description, ...(fallback && { default: fallback }), example };
    });
  };
  for (const name of found.keys()) found.set(name, entriesOf(name));
  const ofFeatures = { attributes: [], slots: [], cssParts: [], cssProperties: [], events: [] };
  for (const { ts, node, path, isTable, isTagged } of nodes) {
    if (isTagged) readTags(ts, node, ofFeatures);
    if (isTable && (isRow(path) || path.endsWith('element-attributes.ts')))
      ofFeatures.attributes.push(...found.get(node.name.getText()));
  }
  return { found, ofFeatures };
}

/** Reads the tags of a feature's comment, as the analyzer reads those of a class. */
function readTags(ts, node, into) {
  const tags = ts
    .getJSDocCommentsAndTags(node)
    .filter(ts.isJSDoc)
    .flatMap(({ tags = [] }) => tags);
  for (const { tagName, comment } of tags) {
    const text = ts.getTextOfJSDocComment(comment) ?? '';
    const [, type, name, fallback, description] =
      /^(?:\{(.*?)\} )?(?:\[?(\S+?)(?:=(.*?)\])?) - ([^]*)$/.exec(text) ?? [];
    if (name === undefined) continue;
    if (tagName.text === 'slot') into.slots.push({ name, description });
    if (tagName.text === 'csspart') into.cssParts.push({ name, description });
    if (tagName.text === 'cssproperty')
      into.cssProperties.push({ name, description, ...(fallback && { default: fallback }) });
    if (tagName.text === 'fires') into.events.push({ name, type: { text: type }, description });
  }
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
