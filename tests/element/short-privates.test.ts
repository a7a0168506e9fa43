/** Private names of the CDN build, which classes share, are each class's own. */
import assert from 'node:assert/strict';
import { test } from 'node:test';
import { rollup, type Plugin } from 'rollup';

const scripts = '../../packages/element/scripts/';
const { shortPrivates } = (await import(`${scripts}short-privates.mjs`)) as { shortPrivates: () => Plugin };

const SOURCE = `
class Counter {
  #count = 0;
  #step;
  static #made = 0;
  constructor(step) { this.#step = step; Counter.#made++; }
  get #next() { return this.#count + this.#step; }
  set #next(value) { this.#count = value; }
  static #isOne(it) { return #count in it; }
  static has(it) { return Counter.#isOne(it); }
  static get made() { return Counter.#made; }
  up() { this.#next = this.#next; return this.#count; }
  watcher() {
    const counter = this;
    return new (class {
      #step = '#count';
      read() { return [this.#step, counter.#count]; }
    })();
  }
}
class Other { #label = 'x'; get label() { return this.#label; } static is(it) { return #label in it; } }
export const answers = () => {
  const counter = new Counter(3);
  counter.up();
  return [counter.up(), counter.watcher().read(), Counter.has(counter), Counter.has(new Other()), Other.is(counter), new Other().label, Counter.made];
};
`;

interface Module {
  readonly answers: () => unknown;
}
const asModule = async (code: string): Promise<Module> =>
  (await import(`data:text/javascript,${encodeURIComponent(code)}`)) as Module;

test('the first private name of every class is one, the second another, and none means what it did not', async () => {
  const source: Plugin = { name: 'source', resolveId: (id) => id, load: () => SOURCE };
  const bundle = await rollup({ input: 'source.js', plugins: [source, shortPrivates()] });
  const { output } = await bundle.generate({ format: 'es', sourcemap: 'hidden' });
  const [{ code, map }] = output;
  const expected = [6, ['#count', 6], true, false, false, 'x', 1];
  assert.deepEqual((await asModule(SOURCE)).answers(), expected);
  assert.deepEqual((await asModule(code)).answers(), expected);

  const fields = [...code.matchAll(/^\s*(?:class Other \{ )?(#\w+) =/gm)].map(([, name]) => name);
  assert.equal(fields.length, 3, code);
  const [count, inner, label] = fields;
  assert.equal(label, count, 'of two classes');
  assert.notEqual(inner, count, 'of a class in a class');
  assert.ok(map!.names.includes('#count') && map!.names.includes('#label'), 'debuggers know their names');
});

test('modules without private names are left alone', async () => {
  const code = 'export const answers = () => "#count";\n';
  const source: Plugin = { name: 'source', resolveId: (id) => id, load: () => code };
  const bundle = await rollup({ input: 'source.js', plugins: [source, shortPrivates()] });
  const { output } = await bundle.generate({ format: 'es' });
  assert.match(output[0].code, /"#count"/);
});
