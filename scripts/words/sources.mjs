/** Texts for users in sources: comments of the public API, sentences of errors and of pages. */
import { existsSync, readdirSync, readFileSync } from 'node:fs';
import { join, relative } from 'node:path';
import { parseSync } from 'rolldown/utils';
import ts from 'typescript';
import { root } from '../lib/run.mjs';

const PACKAGES = join(root, 'packages');

/** Doors for the packages and the tests of this repository. */
const INTERNAL = ['./stages', './parts'];

/** Modules that a package exports by name. */
function entriesOf(name) {
  const path = join(PACKAGES, name, 'package.json');
  if (!existsSync(path)) return [];
  const { exports = {} } = JSON.parse(readFileSync(path, 'utf8'));
  return Object.entries(exports)
    .filter(([door]) => !INTERNAL.includes(door))
    .map(([, { types = '' }]) => types)
    .filter((types) => types.endsWith('.d.ts'))
    .map((types) => join(PACKAGES, name, types.replace('./dist/', 'src/').replace('.d.ts', '.ts')))
    .filter(existsSync);
}

/** The comments of everything that the packages export, and of its members: `{ file, line, text }`. */
export function publicComments() {
  const entries = readdirSync(PACKAGES).flatMap(entriesOf);
  const { options } = ts.parseJsonConfigFileContent(
    ts.readConfigFile(join(root, 'tsconfig.base.json'), ts.sys.readFile).config,
    ts.sys,
    root,
  );
  // Packages import one another by name, which resolves to built files; sources are enough here.
  const program = ts.createProgram(entries, {
    ...options,
    noEmit: true,
    noLib: true,
    composite: false,
    incremental: false,
    types: [],
  });
  const checker = program.getTypeChecker();
  const found = new Map();
  const visited = new Set();
  for (const entry of entries) {
    const symbol = checker.getSymbolAtLocation(program.getSourceFile(entry));
    for (const exported of symbol ? checker.getExportsOfModule(symbol) : []) visit(exported);
  }
  return [...found.values()];

  function visit(symbol) {
    const target = symbol.flags & ts.SymbolFlags.Alias ? checker.getAliasedSymbol(symbol) : symbol;
    if (visited.has(target)) return;
    visited.add(target);
    for (const declaration of target.declarations ?? []) {
      if (!isOurs(declaration) || isHidden(declaration)) continue;
      take(declaration);
      if (ts.isVariableDeclaration(declaration) && declaration.initializer) table(declaration.initializer);
      const type =
        ts.isClassLike(declaration) || ts.isInterfaceDeclaration(declaration) || ts.isTypeAliasDeclaration(declaration);
      if (!type) continue;
      for (const member of checker.getDeclaredTypeOfSymbol(target).getProperties()) visit(member);
      if (ts.isClassLike(declaration)) target.exports?.forEach(visit);
    }
  }

  /** The members of an object that is exported, such as a table. */
  function table(node) {
    if (!ts.isObjectLiteralExpression(node)) return;
    for (const property of node.properties) take(property);
  }

  function take(node) {
    const file = node.getSourceFile();
    // The comment of a variable belongs to its statement.
    const owner = ts.isVariableDeclaration(node) ? node.parent.parent : node;
    for (const doc of ts.getJSDocCommentsAndTags(owner).filter(ts.isJSDoc)) {
      const key = `${file.fileName}:${doc.pos}`;
      found.set(key, commentOf(file, doc));
    }
  }
}

const isOurs = (node) => /\/packages\/[^/]+\/src\//.test(node.getSourceFile().fileName);
const isHidden = (node) =>
  (ts.getCombinedModifierFlags(node) & (ts.ModifierFlags.Private | ts.ModifierFlags.Protected)) !== 0 ||
  (node.name !== undefined && ts.isPrivateIdentifier(node.name));

function commentOf(file, doc) {
  const { line } = file.getLineAndCharacterOfPosition(doc.getStart());
  const text = doc
    .getText()
    .replace(/^\/\*\*|\*\/$/g, '')
    .replace(/^[ \t]*\* ?/gm, '')
    .replace(/\{@link ([^}]+)\}/g, '`$1`')
    // Names of parameters are code.
    .replace(/@param (\{[^}]*\} )?[\w.]+/g, '`');
  return {
    file: relative(root, file.fileName),
    line: line + 1,
    text: text.replace(/(`+)[^`]+?\1/g, (code) => '`' + code.replace(/[^\n]/g, '')),
  };
}

/** The tables of attributes: their comments are the reference. */
export function attributeComments() {
  return ['viewer/attributes.ts', 'features/children/attributes.ts'].flatMap((name) => {
    const path = join(PACKAGES, 'element/src', name);
    const file = parse(path);
    const found = [];
    const visit = (node) => {
      if (ts.isPropertyAssignment(node)) found.push(...ts.getJSDocCommentsAndTags(node).filter(ts.isJSDoc));
      ts.forEachChild(node, visit);
    };
    visit(file);
    return found.map((doc) => commentOf(file, doc));
  });
}

/** Texts in code of two words or more: errors, warnings, and what pages and the element say. */
export function sentencesInCode(path) {
  const source = readFileSync(path, 'utf8');
  const { program } = parseSync(path, source);
  const found = [];
  const visit = (node) => {
    if (node === null || typeof node !== 'object') return;
    if (Array.isArray(node)) return node.forEach(visit);
    // Styles are no text.
    if (node.type === 'TaggedTemplateExpression' && node.tag.name === 'css') return;
    if (node.type === 'ImportDeclaration') return;
    const text = textOf(node);
    if (text !== undefined && isProse(text))
      found.push({ file: relative(root, path), line: source.slice(0, node.start).split('\n').length, text });
    for (const key in node) visit(node[key]);
  };
  visit(program);
  return found;
}

/** The same of Python, without docstrings. */
export function sentencesInPython(path) {
  const source = readFileSync(path, 'utf8').replace(/"""[\s\S]*?"""/g, (found) => found.replace(/[^\n]/g, ''));
  return [...source.matchAll(/"((?:[^"\\\n]|\\.)*)"/g)]
    .map(({ 1: text, index }) => ({
      file: relative(root, path),
      line: source.slice(0, index).split('\n').length,
      text: text.replace(/\{[^{}]*\}/g, '`'),
    }))
    .filter(({ text }) => isProse(text));
}

/** A sentence, or a label such as "First frame": no identifier, selector or code. */
const isProse = (text) =>
  /^[^{}]*$/.test(text) && /[a-z] [A-Za-z]/.test(text) && (text.match(/[A-Za-z]{2,}/g) ?? []).length >= 2;

function textOf({ type, value, quasis }) {
  if (type === 'Literal' && typeof value === 'string') return value;
  return type === 'TemplateLiteral' ? quasis.map(({ value: { cooked } }) => cooked).join(' ` ') : undefined;
}

const parse = (path) => ts.createSourceFile(path, readFileSync(path, 'utf8'), ts.ScriptTarget.Latest, true);
