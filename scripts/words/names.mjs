/**
 * The parts of names that the project has retired, and a rule of the linter that refuses a declaration with one of them. `lint:words` applies the same list to WGSL.
 */

/** `[part, what to write instead]`. */
export const RETIRED_PARTS = new Map(
  Object.entries({
    'wish wishes wished': 'request',
    'lever levers': 'settings',
    'leaver leavers': 'evictee',
    'noting noted': 'auxiliary',
    'told tell tells': 'report, notify',
    anew: 'again, retry',
    spare: 'pingPong, releasable',
    gathered: 'cullStats',
    'picture pictures': 'image, frame',
    'pace ladder': 'quality, rate, levels',
    'colour colours coloured': 'color',
    'centre centres centred': 'center',
    'metre metres': 'meter',
    'grey greys': 'gray',
    'behaviour behaviours': 'behavior',
    'neighbour neighbours neighbouring': 'neighbor',
    'normalise normalised': 'normalize',
    'most least': 'max, min',
    likely: 'preferred',
    patience: 'timeout',
  }).flatMap(([parts, instead]) => parts.split(' ').map((part) => [part, instead])),
);

/** Names that stored files carry: keys of contracts in ONNX files (docs/decisions/0031-public-names.md). */
const STORED = { 'packages/core/src/contract/': ['most', 'metresPerUnit'] };

/** The retired part of a name, or undefined. `path` is relative to the repository. */
export function retiredPartOf(name, path) {
  const stored = Object.entries(STORED).find(([folder]) => path.includes(folder));
  if (stored?.[1].includes(name)) return undefined;
  const parts = name
    .replace(/([a-z0-9])([A-Z])/g, '$1 $2')
    .replace(/([A-Z])([A-Z][a-z])/g, '$1 $2')
    .toLowerCase()
    .split(/[^a-z]+/);
  // "At most" compares: it names no limit.
  return parts.find((part, i) => RETIRED_PARTS.has(part) && parts[i - 1] !== 'at');
}

/** Declarations of a name; what refers to one is not reported. */
const DECLARED = {
  VariableDeclarator: ({ id }) => bound(id),
  FunctionDeclaration: ({ id, params }) => [id, ...params.flatMap(bound)],
  FunctionExpression: ({ params }) => params.flatMap(bound),
  ArrowFunctionExpression: ({ params }) => params.flatMap(bound),
  ClassDeclaration: ({ id }) => [id],
  TSInterfaceDeclaration: ({ id }) => [id],
  TSTypeAliasDeclaration: ({ id }) => [id],
  MethodDefinition: keyOf,
  PropertyDefinition: keyOf,
  AccessorProperty: keyOf,
  TSMethodSignature: keyOf,
  TSPropertySignature: keyOf,
};

export const retiredNames = {
  meta: {
    type: 'problem',
    schema: [],
    messages: { retired: '"{{part}}" in "{{name}}" is retired. Write: {{instead}}.' },
  },
  create(context) {
    const check = (names) => {
      for (const node of names) {
        const part = node && retiredPartOf(node.name, context.filename);
        if (part)
          context.report({
            node,
            messageId: 'retired',
            data: { part, name: node.name, instead: RETIRED_PARTS.get(part) },
          });
      }
    };
    return Object.fromEntries(Object.entries(DECLARED).map(([type, names]) => [type, (node) => check(names(node))]));
  },
};

/** The names that a pattern binds. */
function bound(pattern) {
  switch (pattern?.type) {
    case 'Identifier':
      return [pattern];
    case 'ObjectPattern':
      return pattern.properties.flatMap((property) => bound(property.value ?? property.argument));
    case 'ArrayPattern':
      return pattern.elements.flatMap(bound);
    case 'AssignmentPattern':
      return bound(pattern.left);
    case 'RestElement':
      return bound(pattern.argument);
    case 'TSParameterProperty':
      return bound(pattern.parameter);
    default:
      return [];
  }
}

function keyOf({ key, computed }) {
  return !computed && (key.type === 'Identifier' || key.type === 'PrivateIdentifier') ? [key] : [];
}
