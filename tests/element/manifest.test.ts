/** The manifest that editors, wrappers and the docs are made from, held against the element itself. */
import assert from 'node:assert/strict';
import { existsSync, readdirSync, readFileSync } from 'node:fs';
import { test } from 'node:test';
import { fileURLToPath } from 'node:url';
import ts from 'typescript';
import { GaussianSplatElement } from '@gaussian-splat/element/element.js';
import { SplatMeshElement, SplatSceneElement } from '@gaussian-splat/element/scenes.js';

const folder = fileURLToPath(new URL('../../packages/element/', import.meta.url));
const source = (name: string): string => readFileSync(`${folder}src/${name}`, 'utf8');
/** Paths of all modules of features. Those of few pages are in separate chunks. */
const features = readdirSync(`${folder}src/features`, { recursive: true, encoding: 'utf8' })
  .filter((name) => name.endsWith('.ts'))
  .map((name) => `features/${name}`);
const rows = features.filter((name) => name.endsWith('/row.ts'));

interface Named {
  readonly name: string;
  readonly description?: string;
}
interface Member extends Named {
  readonly kind: string;
  readonly static?: boolean;
  readonly type?: { readonly text: string };
  readonly return?: { readonly type?: { readonly text: string } };
  readonly parameters?: readonly (Named & { readonly type?: { readonly text: string } })[];
}
interface Declaration {
  readonly tagName?: string;
  readonly attributes: readonly (Named & { readonly type?: { readonly text: string } })[];
  readonly members: readonly Member[];
  readonly events: readonly (Named & { readonly type?: { readonly text: string } })[];
  readonly slots: readonly Named[];
  readonly cssParts: readonly Named[];
  readonly cssProperties: readonly Named[];
  readonly cssStates: readonly Named[];
}
interface Manifest {
  readonly modules: readonly {
    readonly path: string;
    readonly declarations: readonly Declaration[];
    readonly exports: readonly { readonly kind: string; readonly name: string }[];
  }[];
}

const path = `${folder}custom-elements.json`;
const isBuilt = existsSync(path);
const manifest = isBuilt ? (JSON.parse(readFileSync(path, 'utf8')) as Manifest) : undefined;
const element = manifest?.modules
  .flatMap(({ declarations }) => declarations)
  .find((d) => d.tagName === 'gaussian-splat');
const namesOf = (items: readonly Named[] = []): string[] => items.map(({ name }) => name).sort();
const unique = (names: Iterable<string>): string[] => [...new Set(names)].sort();
const matches = (text: string, pattern: RegExp): string[] =>
  unique([...text.matchAll(pattern)].map(([, name]) => name));

const check = (title: string, body: () => void | Promise<void>): void =>
  void test(title, { skip: isBuilt ? false : 'no manifest: npm run build' }, body);

check('defines gaussian-splat in modules that exist', () => {
  assert.ok(element, 'an element');
  for (const module of manifest?.modules ?? []) assert.ok(existsSync(folder + module.path), module.path);
  const definitions = manifest?.modules.flatMap((module) =>
    module.exports.filter(({ kind }) => kind === 'custom-element-definition').map(({ name }) => [module.path, name]),
  );
  assert.deepEqual(definitions, [['dist/index.js', 'gaussian-splat']]);
});

check('names the attributes that the element observes, each with a description', () => {
  assert.deepEqual(namesOf(element?.attributes), [...GaussianSplatElement.observedAttributes].sort());
  for (const { name, description } of element?.attributes ?? []) assert.ok(description, name);
});

check('names the attributes of the children, and only members that they have, each described', () => {
  for (const [tag, kind] of [
    ['splat-scene', SplatSceneElement],
    ['splat-mesh', SplatMeshElement],
  ] as const) {
    const child = manifest?.modules.flatMap(({ declarations }) => declarations).find((d) => d.tagName === tag);
    // `hidden` is the platform's, and in no table.
    const observed = kind.observedAttributes.filter((name) => name !== 'hidden').sort();
    assert.deepEqual(namesOf(child?.attributes), observed, tag);
    const reactive = new Set([...kind.elementProperties.keys()].map(String));
    // Methods that an element has from its first splats on.
    const given = new Set(matches(source('sources/splats/splat-input.ts'), /^ {6}(\w+): async \(/gm));
    for (const { name, description, type, return: returned } of child?.members ?? []) {
      assert.ok(name in kind.prototype || reactive.has(name) || given.has(name), `${tag} ${name}`);
      assert.ok(description && (type ?? returned?.type)?.text, `${tag} ${name}: description and type`);
    }
    assert.ok(namesOf(child?.members).includes('currentTime'), tag);
  }
});

check('names the events of the typed map, with their types, and every one that the sources dispatch', () => {
  const typed = new Map(
    ['viewer/events.ts', ...rows].flatMap((name) => {
      const found: (readonly [string, string])[] = [];
      const visit = (node: ts.Node): void => {
        if (ts.isInterfaceDeclaration(node) && node.name.text === 'GaussianSplatEventMap')
          for (const m of node.members.filter(ts.isPropertySignature))
            found.push([ts.isStringLiteral(m.name) ? m.name.text : m.name.getText(), m.type?.getText() ?? '']);
        ts.forEachChild(node, visit);
      };
      visit(ts.createSourceFile(name, source(name), ts.ScriptTarget.Latest, true));
      return found;
    }),
  );
  assert.deepEqual(namesOf(element?.events), [...typed.keys()].sort());
  for (const { name, type } of element?.events ?? []) assert.equal(type?.text, typed.get(name), name);
  const sources = [
    ...['viewer/viewer.ts', 'viewer/source-entry.ts', 'viewer/source-list.ts', 'sources/generator/dynamic-wiring.ts'],
    ...features,
  ]
    .map(source)
    .join('\n');
  const dispatched = matches(sources, /new (?:Custom|Progress)?Event\('([a-z-]+)'/g);
  assert.ok(dispatched.length > 5, dispatched.join());
  // A label of the page gets an event of its own.
  for (const name of dispatched) assert.ok(typed.has(name) || name === 'hotspot-visibility', name);
});

check('names the slots, parts, custom properties and states that there are', () => {
  const late = ['viewer/poster-image.ts', ...features].map(source);
  // The code of VR and of AR forms its names from the kind of session.
  for (const kind of ['vr', 'ar'])
    late.push(source('features/xr/xr-offer.ts').replaceAll('`${kind.name}-button`', `'${kind}-button'`));
  const [template, styles] = ['viewer/template.ts', 'viewer/styles.ts'].map((name) =>
    [source(name), ...late].join('\n'),
  );
  const slots = [/<slot name="([a-z-]+)"/g, /createElement\('slot'\), \{ name: '([a-z-]+)'/g].flatMap((pattern) =>
    matches(template, pattern),
  );
  assert.deepEqual(namesOf(element?.slots), unique([...slots, 'hotspot-*', 'sound']));
  const panelParts = matches(source('sources/generator/controls-panel.ts'), /part: '([a-z-]+)'/g);
  assert.ok(panelParts.length > 0);
  const parts = [/part="([a-z-]+)"/g, /'part', '([a-z-]+)'/g, /[bB]utton\(\s*'([a-z-]+)'/g].flatMap((pattern) =>
    matches(template, pattern),
  );
  assert.deepEqual(namesOf(element?.cssParts), unique([...parts, ...panelParts]));
  assert.deepEqual(namesOf(element?.cssProperties), matches(styles, /var\((--[a-z-]+)/g));
  const [, states] = /const STATES = \[([^\]]+)\]/.exec(source('viewer/element.ts')) ?? [];
  assert.deepEqual(namesOf(element?.cssStates), matches(states, /'([a-z]+)'/g));
});

check('names members that exist, and no private one', () => {
  const { prototype } = GaussianSplatElement;
  const reactive = new Set([...GaussianSplatElement.elementProperties.keys()].map(String));
  const members = element?.members ?? [];
  assert.ok(members.length > 60, `${members.length} members`);
  for (const { name, static: isStatic } of members) {
    assert.ok(isStatic ? name in GaussianSplatElement : name in prototype || reactive.has(name), name);
    assert.ok(!name.startsWith('#') && name !== 'core', name);
  }
  for (const name of ['play', 'positionFromPoint', 'toBlob', 'cameraOrbit']) {
    assert.ok(
      members.some((member) => member.name === name),
      name,
    );
  }
});

check('every member has a type and a description, every parameter a name and a type', () => {
  for (const { name, kind, type, description, parameters = [], return: returned } of element?.members ?? []) {
    assert.ok(kind === 'method' ? returned?.type?.text : type?.text, `${name}: type`);
    assert.ok(description, `${name}: description`);
    for (const parameter of parameters) {
      assert.match(parameter.name, /^\w+$/, `${name}: name of a parameter`);
      assert.ok(parameter.type?.text, `${name}: type of ${parameter.name}`);
    }
  }
  const typeOf = (name: string): string | undefined => {
    const member = element?.members.find((one) => one.name === name);
    return (member?.return ?? member)?.type?.text;
  };
  assert.deepEqual(['play', 'toBlob', 'positionFromPoint', 'sharedDevice'].map(typeOf), [
    'Promise<void>',
    'Promise<Blob>',
    'Promise<PickedPoint | null>',
    'SharedDevice',
  ]);
});

check('its keywords are those that the attributes take, the default first', async () => {
  const { readAttributes } = (await import(`${folder}dist/viewer/element-attributes.js`)) as {
    readAttributes: (raw: object, warn: (sentence: string) => void) => Record<string, unknown>;
  };
  const enumerated = (element?.attributes ?? [])
    .map(({ name, type }) => ({ name, keywords: matches(type?.text ?? '', /'([a-z-]+)'/g) }))
    .filter(({ keywords }) => keywords.length > 0);
  assert.ok(enumerated.length >= 8, enumerated.map(({ name }) => name).join());
  const camelCase = (name: string): string => name.replace(/-(.)/g, (_, letter: string) => letter.toUpperCase());
  for (const { name, keywords } of enumerated) {
    for (const keyword of keywords) {
      const warnings: string[] = [];
      readAttributes({ [camelCase(name)]: keyword }, (sentence) => warnings.push(sentence));
      assert.deepEqual(warnings, [], `${name}="${keyword}"`);
    }
    const warnings: string[] = [];
    readAttributes({ [camelCase(name)]: 'no-such-word' }, (sentence) => warnings.push(sentence));
    assert.equal(warnings.length, 1, `${name}="no-such-word"`);
    for (const keyword of matches(/one of ([a-z, -]+), found/.exec(warnings[0])?.[1] ?? '', /([a-z-]+)/g)) {
      assert.ok(keywords.includes(keyword), `${name} takes ${keyword}, which the manifest does not know`);
    }
  }
});

check('the table of the guide is what the build makes of it, with an example that each attribute takes', async () => {
  const { attributeRows } = (await import(`${folder}scripts/attributes.mjs`)) as {
    attributeRows: (attributes: unknown) => string;
  };
  const guide = readFileSync(`${folder}../../docs/guide/attributes.md`, 'utf8');
  assert.ok(guide.includes(`\n\n${attributeRows(element?.attributes)}\n\n`), 'npm run build writes it again');
  const { readAttributes } = (await import(`${folder}dist/viewer/element-attributes.js`)) as {
    readAttributes: (raw: object, warn: (sentence: string) => void) => Record<string, unknown>;
  };
  for (const { name, fieldName, example = '' } of (element?.attributes ?? []) as (Named & Record<string, string>)[]) {
    const { written, value = '' } = /^(?<written>[a-z0-9-]+)(=(["'])(?<value>.+)\3)?$/.exec(example)?.groups ?? {};
    assert.equal(written, name, `the example of ${name}: ${example}`);
    const warnings: string[] = [];
    readAttributes({ [fieldName]: value }, (sentence) => warnings.push(sentence));
    assert.deepEqual(warnings, [], example);
  }
});

check('custom data and web-types name the same attributes', () => {
  const data = JSON.parse(readFileSync(`${folder}vscode.html-custom-data.json`, 'utf8')) as {
    tags: { name: string; attributes: (Named & { values?: Named[] })[] }[];
  };
  const types = JSON.parse(readFileSync(`${folder}web-types.json`, 'utf8')) as {
    contributions: { html: { elements: { name: string; attributes: Named[] }[] } };
  };
  const observed = [...GaussianSplatElement.observedAttributes].sort();
  for (const tags of [data.tags, types.contributions.html.elements]) {
    const tag = tags.find(({ name }) => name === 'gaussian-splat');
    assert.deepEqual(unique(namesOf(tag?.attributes)), observed);
  }
  for (const { name, values = [] } of data.tags.flatMap(({ attributes }) => attributes)) {
    for (const value of values) assert.match(value.name, /^[\w-]+$/, `a word that editors offer for ${name}`);
  }
});
