/** The shaders of the CDN build, whose names and spaces are shortened, do what those of the packages do. */
import assert from 'node:assert/strict';
import { cpSync, mkdirSync, mkdtempSync, readFileSync, rmSync, writeFileSync } from 'node:fs';
import { basename, dirname, join } from 'node:path';
import { after, test } from 'node:test';
import { fileURLToPath, pathToFileURL } from 'node:url';
import { passesSelfTest } from '@gaussian-splat/renderer/stages';
import * as stages from '@gaussian-splat/renderer/stages';
import { requestNodeAdapter } from '../../packages/cli/src/lib/node-gpu.mjs';
import { endNodeDevice } from '../support/node-device.js';

/** Functions of the plugin's own module and of others for this test. */
interface Plugin {
  readonly piecesIn: (text: string) => Map<string, string>;
  readonly joinedIn: (text: string) => string[][];
  readonly SHADER_FILES: readonly string[];
  readonly shortShaders: () => {
    buildStart(): void;
    transform(code: string, id: string): { readonly code: string } | null;
  };
}
interface Token {
  readonly lexeme: string;
  readonly type: { readonly name: string };
}
type Placed = readonly { readonly binding: number }[];
interface Reflect {
  readonly WgslScanner: new (code: string) => { scanTokens(): Token[] };
  readonly WgslReflect: new (code: string) => Readonly<Record<'uniforms' | 'storage' | 'textures', Placed>>;
}
const scripts = '../../packages/element/scripts/';
const { piecesIn, joinedIn, SHADER_FILES, shortShaders } = (await import(`${scripts}shader-plugin.mjs`)) as Plugin;
const { shortened } = (await import(`${scripts}short-wgsl.mjs`)) as {
  shortened: (pieces: Map<string, string>, joined: readonly (readonly string[])[]) => Map<string, string>;
};
const reflection: string = 'wgsl_reflect/wgsl_reflect.module.js';
const { WgslReflect, WgslScanner } = (await import(reflection)) as Reflect;

interface Stage {
  readonly name: string;
  readonly bindings: Readonly<Record<string, { readonly binding: number; readonly type: string }>>;
  code: string;
}

const isStage = (value: unknown): value is Stage => typeof value === 'object' && value !== null && 'code' in value;
const stagesIn = (module: object): Stage[] => Object.values(module).filter(isStage);
const cache = fileURLToPath(new URL('../../.cache/', import.meta.url));
mkdirSync(cache, { recursive: true });
const folder = mkdtempSync(join(cache, 'short-shaders-'));
after(() => {
  rmSync(folder, { recursive: true, force: true });
  endNodeDevice();
});

/** The stages of all files, as the build and as the bundle has them. */
async function bothForms(): Promise<{ readable: Stage[]; short: Stage[] }> {
  const plugin = shortShaders();
  plugin.buildStart();
  const [readable, short]: [Stage[], Stage[]] = [[], []];
  const copyOf = (file: string): string => join(folder, basename(dirname(dirname(dirname(file)))), basename(file));
  // Shader files import one another: all short ones are in place before the first is loaded.
  for (const file of SHADER_FILES) cpSync(dirname(file), dirname(copyOf(file)), { recursive: true });
  for (const file of SHADER_FILES) {
    const { code } = plugin.transform(readFileSync(file, 'utf8'), file)!;
    // Shaders of optimize import their shared pieces from the renderer's.
    writeFileSync(copyOf(file), code.replace('@gaussian-splat/renderer/stages', '../renderer/shaders.js'));
  }
  for (const file of SHADER_FILES) {
    short.push(...stagesIn((await import(pathToFileURL(copyOf(file)).href)) as object));
    readable.push(...stagesIn((await import(pathToFileURL(file).href)) as object));
  }
  return { readable, short };
}

const forms = await bothForms();

/** wgsl_reflect takes `]-1` for a bracket and a negative number. */
const spaced = (code: string): string => code.replace(/(?<=[\w\])])(?<!\b[\da-fx.]+[ep])-(?=[\d.])/g, '- ');
const scan = (code: string): Token[] => new WgslScanner(spaced(code)).scanTokens();

/** Words in attributes belong to the language: those behind `@`, and behind `@builtin(`. */
function isOfAttribute(tokens: readonly Token[], at: number): boolean {
  const [word, bracket, before] = [3, 2, 1].map((back) => tokens[at - back]?.lexeme);
  return before === '@' || (before === '(' && ['builtin', 'interpolate'].includes(bracket) && word === '@');
}

/** The position distinguishes fields from other names: `.near` is not `near`. */
function isField(tokens: readonly Token[], at: number, isInStruct: boolean): boolean {
  return tokens[at - 1].lexeme === '.' || (isInStruct && tokens[at + 1].lexeme === ':');
}

test('token by token they are the same except for names, each has one other, and two in a declaration stay two', () => {
  assert.equal(forms.short.length, forms.readable.length);
  assert.ok(forms.readable.length > 35, `${forms.readable.length} stages`);
  const shortOf = new Map<string, string>();
  let [before, now] = [0, 0];
  forms.readable.forEach(({ name, code }, k) => {
    const [was, is] = [scan(code), scan(forms.short[k].code)];
    assert.equal(is.length, was.length, name);
    // The function, struct, constant or variable that contains a token.
    let nameOf = new Map<string, string>();
    let isInStruct = false;
    let depth = 0;
    was.forEach(({ lexeme, type }, at) => {
      const short = is[at].lexeme;
      if (type.name !== 'ident' || is[at].type.name !== 'ident' || isOfAttribute(was, at)) {
        assert.equal(short, lexeme, `${name}: token ${at}`);
        if (lexeme === 'struct') isInStruct = true;
        if (lexeme === '{') depth++;
        if (lexeme === '}') depth--;
        if (depth > 0 || !/[;}]/.test(lexeme)) return;
        nameOf = new Map();
        isInStruct = false;
        return;
      }
      const kind = isField(was, at, isInStruct) ? '.' : '';
      const [long, own] = [kind + lexeme, kind + short];
      assert.equal(shortOf.get(long) ?? own, own, `${name}: ${long}`);
      assert.equal(nameOf.get(own) ?? long, long, `${name}: ${own}`);
      shortOf.set(long, own);
      nameOf.set(own, long);
    });
    before += code.length;
    now += forms.short[k].code.length;
  });
  console.log(`${shortOf.size} names; ${before} characters, ${now} short`);
  assert.ok(shortOf.size > 700 && now < 0.6 * before);
});

test('bindings are where they were', () => {
  forms.short.forEach(({ name, bindings, code }) => {
    const { uniforms, storage, textures } = new WgslReflect(spaced(code));
    const found = [...uniforms, ...storage, ...textures].map(({ binding }) => binding).sort((a, b) => a - b);
    const expected = Object.values(bindings).map(({ binding }) => binding);
    assert.deepEqual(
      found,
      expected.sort((a, b) => a - b),
      name,
    );
  });
});

/** A device of its own, with what there is of some features. */
async function deviceWith(...wanted: GPUFeatureName[]): Promise<GPUDevice> {
  const adapter = await requestNodeAdapter();
  return adapter.requestDevice({ requiredFeatures: wanted.filter((name) => adapter.features.has(name)) });
}

test('Dawn takes every one of them', async () => {
  const device = await deviceWith();
  for (const { name, code: own } of forms.short) {
    const { messages } = await device.createShaderModule({ code: own }).getCompilationInfo();
    assert.deepEqual(
      messages.map(({ message }) => message),
      [],
      name,
    );
  }
  device.destroy();
});

test('every variant passes the self-test', async () => {
  const own = new Map(forms.short.map((stage) => [stage.name, stage.code]));
  // In this process the renderer has those of the bundle from here on; a device of its own has none of the others yet.
  for (const stage of stagesIn(stages)) stage.code = own.get(stage.name)!;
  const device = await deviceWith('float32-blendable');
  for (const threads of ['parallel', 'serial'] as const) {
    for (const rasterizer of ['quads', 'tiles'] as const) {
      const name = `${threads} ${rasterizer}`;
      assert.ok(await passesSelfTest(device, { threads, rasterizer }), name);
    }
  }
  device.destroy();
});

/** WGSL that is easily spoiled. */
const HARD = `struct View {
eye: vec3f,
w: f32,
}
override is_final: bool = false;
@group(0) @binding(0) var<uniform> view: View;
@group(0) @binding(1) var<storage, read_write> position: array<u32>;
fn shade(distance: f32, step: f32) -> f32 {
let taken = distance - -step;
let near = length(view.eye) > 1.0 && !(taken >= 2.0);
return select(view.w, frexp(taken).fract, near || is_final);
}
@vertex
fn main(@builtin(vertex_index) index: u32) -> @builtin(position) vec4f {
let far = distance(view.eye, vec3f(1.0).zyx);
var<private> unused: f32;
return vec4f(shade(far, 0.5e-3), f32(position[index]) , 0.0, 1.0);
}`;

test('words of the language, overridable constants and shadowed functions stay', () => {
  const short = shortened(new Map([['hard', HARD]]), [['hard']]).get('hard')!;
  for (const word of [
    'is_final',
    '@builtin(position)',
    '@builtin(vertex_index)',
    'distance(',
    '.fract',
    '.zyx',
    'fn main(',
    '0.5e-3',
  ]) {
    assert.ok(short.includes(word), `${word}:\n${short}`);
  }
  assert.match(short, /let \w+=distance- -/);
  assert.match(short, /}@vertex fn main/);
  assert.doesNotMatch(short, /\n/);
  assert.match(short, /let \w+=distance\(/);
  assert.doesNotMatch(short, /shade|view|near|taken/i);
  assert.equal(piecesIn('export const aPart = "fn \\"x\\"\\n";\n').get('aPart'), 'fn "x"\n');
  assert.deepEqual(joinedIn("  code: aPart + '\\n' + bPart,\n  code: bPart,\n"), [['aPart', 'bPart'], ['bPart']]);
});

/** Two shaders share `both`: what only one of them has may be called as what only the other has. */
const PIECES = {
  both: `struct Side {
left: f32,
far: f32,
}
fn twice(value: f32) -> f32 {
return value + value;
}`,
  one: `var<private> first: f32;
fn main() -> f32 {
let side = Side(first, 1.0);
return twice(side.far);
}`,
  other: `var<private> second: f32;
fn main() -> f32 {
var sum = 0.0;
for (var far = 0.0; far < second; far += 1.0) { sum += twice(far); }
return sum;
}`,
};

test('names that never meet may become one, and others do not', () => {
  const joined = [
    ['both', 'one'],
    ['both', 'other'],
  ];
  const short = shortened(new Map(Object.entries(PIECES)), joined);
  const found = (key: string, pattern: RegExp): string => pattern.exec(short.get(key)!)![1];
  const [first, second] = [found('one', /var<private>(\w+):/), found('other', /var<private>(\w+):/)];
  const twice = found('both', /fn (\w+)\(/);
  const far = found('both', /,(\w+):f32,}/);
  assert.notEqual(first, twice);
  assert.equal(found('one', new RegExp(`return ${twice}\\(\\w+\\.(\\w+)\\)`)), far);
  const [, sum, counter] = /var (\w+)=0\.0;for\(var (\w+)=/.exec(short.get('other')!)!;
  assert.equal(new Set([sum, counter, second, twice]).size, 4);
  const side = found('one', /let (\w+)=/);
  assert.ok(new Set([first, side, second, sum, counter]).size < 5, 'of two shaders');
  assert.ok(short.get('other')!.includes(`{${sum}+=${twice}(${counter});}`));
});
