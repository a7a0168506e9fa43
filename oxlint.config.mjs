/** `npm run lint`: the compiler refuses enums and unknown names. */
import { readdirSync } from 'node:fs';
import lit from 'eslint-plugin-lit';
import wc from 'eslint-plugin-wc';

/**
 * Allowed imports (docs/architecture.md). A package may import the listed packages, and no other package of this
 * repository.
 */
const MAY_IMPORT = {
  core: [],
  formats: ['core'],
  renderer: ['core'],
  generator: ['core', 'renderer'],
  check: ['core', 'generator'],
  optimize: ['core', 'formats', 'renderer'],
  element: ['core', 'formats', 'generator', 'renderer'],
  react: ['element'],
  three: ['core', 'renderer'],
};

/** The packages that may load ONNX Runtime. */
const RUN_MODELS = ['generator', 'check'];

const BROWSER_ONLY = ['document', 'window', 'customElements', 'HTMLElement', 'localStorage'];

/** Imports that a package may not have. */
const restrictedIn = (name) => [
  ...Object.keys(MAY_IMPORT)
    .filter((other) => other !== name && !MAY_IMPORT[name].includes(other))
    .map((other) => ({
      regex: `^@gaussian-splat/${other}(/|$)`,
      message: `${name} must not know ${other}: see docs/architecture.md.`,
    })),
  { regex: name === 'element' ? '^(\\.\\./){3}' : '^(\\.\\./){2}', message: 'Import another package by its name.' },
  ...(name === 'check' ? [] : [{ regex: '^(node:.*|fs|path)$', message: 'Packages run in browsers.' }]),
  ...(RUN_MODELS.includes(name) ? [] : [{ regex: '^onnxruntime', message: 'Only generator and check run models.' }]),
  ...(name === 'element' ? [] : [{ regex: '^lit(/|$)', message: 'Only the element touches the DOM.' }]),
];
const importRule = (name, ...more) => ({
  'no-restricted-imports': ['error', { patterns: [...restrictedIn(name), ...more] }],
});

const directions = Object.keys(MAY_IMPORT).map((name) => ({
  files: [`packages/${name}/src/**/*.ts`],
  rules: {
    ...importRule(name),
    'no-restricted-globals':
      name === 'element'
        ? 'off'
        : ['error', ...BROWSER_ONLY.map((global) => ({ name: global, message: 'Only the element touches the DOM.' }))],
  },
}));

const FEATURES = readdirSync(new URL('packages/element/src/features', import.meta.url));

export default {
  plugins: ['typescript'],
  jsPlugins: ['./scripts/words/lint.mjs', 'eslint-plugin-lit', 'eslint-plugin-wc'],
  categories: { correctness: 'off' },
  ignorePatterns: [
    '**/dist/',
    '**/cdn/',
    '**/generated/',
    '**/node_modules/',
    '.cache/',
    'test-output/',
    'coverage/',
    '**/assembly/',
    'packages/notebook/src/',
    'packages/notebook/build/',
  ],
  rules: {
    // typescript-eslint's list of recommended rules.
    'no-array-constructor': 'error',
    'no-unused-expressions': 'error',
    'no-unused-vars': 'error',
    'typescript/ban-ts-comment': 'error',
    'typescript/no-duplicate-enum-values': 'error',
    'typescript/no-empty-object-type': 'error',
    'typescript/no-explicit-any': 'error',
    'typescript/no-extra-non-null-assertion': 'error',
    'typescript/no-misused-new': 'error',
    'typescript/no-namespace': 'error',
    'typescript/no-non-null-asserted-optional-chain': 'error',
    'typescript/no-require-imports': 'error',
    'typescript/no-this-alias': 'error',
    'typescript/no-unnecessary-type-constraint': 'error',
    'typescript/no-unsafe-declaration-merging': 'error',
    'typescript/no-unsafe-function-type': 'error',
    'typescript/no-wrapper-object-types': 'error',
    'typescript/prefer-as-const': 'error',
    'typescript/prefer-namespace-keyword': 'error',
    'typescript/triple-slash-reference': 'error',
    'words/retired-names': 'error',
  },
  overrides: [
    {
      files: ['**/*.ts'],
      rules: {
        'typescript/consistent-type-imports': ['error', { fixStyle: 'inline-type-imports' }],
        eqeqeq: ['error', 'always'],
        'no-eval': 'error',
        'no-implied-eval': 'error',
        'no-var': 'error',
        'prefer-rest-params': 'error',
        'prefer-spread': 'error',
        'prefer-const': ['error', { destructuring: 'all' }],
      },
    },
    { files: ['packages/*/src/**/*.ts'], rules: { 'typescript/explicit-module-boundary-types': 'error' } },
    ...directions,
    {
      files: ['packages/element/src/**/*.ts'],
      rules: {
        ...lit.configs.recommended.rules,
        ...wc.configs.recommended.rules,
        'wc/guard-super-call': 'off',
        // Rows of features extend the interfaces of the viewer.
        'typescript/no-empty-object-type': ['error', { allowInterfaces: 'always' }],
      },
    },
    // The viewer knows its features by their rows alone, and no feature knows another one.
    {
      files: ['packages/element/src/viewer/**/*.ts'],
      excludeFiles: ['packages/element/src/viewer/feature-table.ts', 'packages/element/src/viewer/feature-classes.ts'],
      rules: importRule('element', { regex: '/features/', message: 'Only feature-table.ts imports features.' }),
    },
    ...FEATURES.map((name) => ({
      files: [`packages/element/src/features/${name}/**/*.ts`],
      rules: importRule('element', { regex: '^\\.\\./[^.]', message: 'A feature knows no other feature.' }),
    })),
  ],
};
