import { readdirSync } from 'node:fs';
import lit from 'eslint-plugin-lit';
import wc from 'eslint-plugin-wc';
import tseslint from 'typescript-eslint';
import { retiredNames } from './scripts/words/names.mjs';

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
      group: [`@gaussian-splat/${other}`, `@gaussian-splat/${other}/*`],
      message: `${name} must not know ${other}: see docs/architecture.md.`,
    })),
  { group: [name === 'element' ? '../../../*' : '../../*'], message: 'Import another package by its name.' },
  ...(name === 'check' ? [] : [{ group: ['node:*', 'fs', 'path'], message: 'Packages run in browsers.' }]),
  ...(RUN_MODELS.includes(name) ? [] : [{ group: ['onnxruntime*'], message: 'Only generator and check run models.' }]),
  ...(name === 'element' ? [] : [{ group: ['lit', 'lit/*'], message: 'Only the element touches the DOM.' }]),
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

export default tseslint.config(
  {
    ignores: [
      '**/dist/',
      '**/cdn/',
      '**/generated/',
      '**/node_modules/',
      '.cache/',
      'test-output/',
      'coverage/',
      '**/assembly/',
      'packages/notebook/{src,build}/',
    ],
  },
  ...tseslint.configs.recommended,
  {
    files: ['**/*.ts'],
    rules: {
      '@typescript-eslint/no-explicit-any': 'error',
      '@typescript-eslint/consistent-type-imports': ['error', { fixStyle: 'inline-type-imports' }],
      'no-restricted-syntax': ['error', { selector: 'TSEnumDeclaration', message: 'Use a union of literals.' }],
      eqeqeq: ['error', 'always'],
      'no-eval': 'error',
      'no-implied-eval': 'error',
      'prefer-const': ['error', { destructuring: 'all' }],
    },
  },
  {
    files: ['**/*.{ts,tsx,mjs,js}'],
    plugins: { words: { rules: { 'retired-names': retiredNames } } },
    rules: { 'words/retired-names': 'error' },
  },
  { files: ['packages/*/src/**/*.ts'], rules: { '@typescript-eslint/explicit-module-boundary-types': 'error' } },
  ...directions,
  {
    files: ['packages/element/src/**/*.ts'],
    plugins: { lit, wc },
    rules: {
      ...lit.configs.recommended.rules,
      ...wc.configs.recommended.rules,
      'wc/guard-super-call': 'off',
      // Rows of features extend the interfaces of the viewer.
      '@typescript-eslint/no-empty-object-type': ['error', { allowInterfaces: 'always' }],
    },
  },
  // The viewer knows its features by their rows alone, and no feature knows another one.
  {
    files: ['packages/element/src/viewer/**/*.ts'],
    ignores: ['packages/element/src/viewer/feature-{table,classes}.ts'],
    rules: importRule('element', { group: ['**/features/**'], message: 'Only feature-table.ts imports features.' }),
  },
  ...FEATURES.map((name) => ({
    files: [`packages/element/src/features/${name}/**/*.ts`],
    rules: importRule('element', { regex: '^\\.\\./[^.]', message: 'A feature knows no other feature.' }),
  })),
);
