/**
 * Describes the element for editors and tools: custom-elements.json from the sources' own comments, and from it custom
 * data for VS Code and web-types for JetBrains. `npm run build` runs it.
 */
import { customElementJetBrainsPlugin } from 'custom-element-jet-brains-integration';
import { customElementVsCodePlugin } from 'custom-element-vs-code-integration';
import { tableOfAttributes } from './scripts/attributes.mjs';

/** Pages import the compiled module. */
const published = (path) => path?.replace(/^src\//, 'dist/').replace(/\.ts$/, '.js');

/**
 * Types as the sources write them, where the analyzer has none: it lets a `@returns` without a type stand for the type of a method, and
 * does not look at what a field is made with.
 */
const typesOfSources = {
  name: 'types-of-sources',
  analyzePhase({ ts, node, moduleDoc }) {
    if (!ts.isClassDeclaration(node)) return;
    const declaration = moduleDoc.declarations?.find(({ name }) => name === node.name?.getText());
    for (const member of node.members) {
      const described = declaration?.members?.find(({ name }) => name === member.name?.getText());
      if (described === undefined) continue;
      if (ts.isMethodDeclaration(member)) describeMethod(ts, described, member);
      else if (member.initializer && ts.isNewExpression(member.initializer)) {
        described.type ??= { text: member.initializer.expression.getText() };
      }
    }
  },
};

function describeMethod(ts, described, { type, parameters }) {
  if (type) described.return = { ...described.return, type: { text: type.getText() } };
  for (const [i, parameter] of (described.parameters ?? []).entries()) {
    // One that is taken apart in the signature has no name of its own.
    if (parameter.name.startsWith('{')) Object.assign(parameter, { name: 'options', optional: true });
    const { initializer } = parameters[i];
    if (initializer && ts.isStringLiteral(initializer)) parameter.type ??= { text: 'string' };
  }
}

/** Keeps what pages may rely on: one class with all that it inherits from ours, and nothing private, protected or internal. */
const publicOnly = {
  name: 'public-only',
  packageLinkPhase({ customElementsManifest: manifest }) {
    manifest.modules = manifest.modules.filter(({ path }) => ENTRIES.includes(path));
    for (const module of manifest.modules) {
      module.path = published(module.path);
      for (const { declaration } of module.exports ?? []) {
        if (declaration.module) declaration.module = published(declaration.module);
      }
      for (const item of module.declarations ?? []) {
        item.superclass = { name: 'LitElement', package: 'lit' };
        item.members = item.members?.filter(isPublic);
        // The empty text is as good as none, and nothing for an editor to offer.
        for (const { type } of item.attributes ?? []) if (type) type.text = type.text.replace(" | ''", '');
        for (const part of [...(item.members ?? []), ...(item.attributes ?? [])]) delete part.inheritedFrom;
      }
    }
  },
};

const ENTRIES = [
  'src/index.ts',
  'src/viewer/element.ts',
  'src/scenes.ts',
  'src/features/children/splat-scene.ts',
  'src/features/children/splat-mesh.ts',
  'src/features/effects/splat-cut.ts',
];
/** Members of the life cycle of Lit and of the platform are inherited, but are no part of the documented interface. */
const LIFE_CYCLE = [
  'core',
  'connectedMoveCallback',
  'entry',
  'place',
  'source',
  'dynamicValues',
  'credentials',
  'hasOwnClock',
  'warn',
  'table',
];
const isPublic = ({ name, privacy }) =>
  !name.startsWith('#') && privacy !== 'private' && privacy !== 'protected' && !LIFE_CYCLE.includes(name);

const files = { outdir: '.', packageJson: false };

export default {
  globs: [
    'src/features/*/row.ts',
    ...ENTRIES,
    'src/viewer/viewing.ts',
    'src/viewer/media.ts',
    'src/viewer/properties.ts',
    'src/viewer/attributes.ts',
    'src/viewer/element-attributes.ts',
    'src/features/children/child.ts',
    'src/features/children/attributes.ts',
    'src/features/effects/attributes.ts',
  ],
  outdir: '.',
  litelement: true,
  packagejson: false,
  plugins: [
    typesOfSources,
    tableOfAttributes(),
    publicOnly,
    customElementVsCodePlugin({ ...files, cssFileName: null, hideLogs: true }),
    customElementJetBrainsPlugin({ ...files, hideLogs: true }),
  ],
};
