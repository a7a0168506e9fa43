/** The worker's code as text, as bundles have it: whole, and complete. */
import assert from 'node:assert/strict';
import { existsSync, readFileSync } from 'node:fs';
import { test } from 'node:test';
import { fileURLToPath } from 'node:url';
import { runInThisContext, Script } from 'node:vm';
import { type CHUNKS, BOOTSTRAP } from '../support/element/loading.js';

const folder = fileURLToPath(new URL('../../packages/element/dist/loading/', import.meta.url));
const skip = existsSync(`${folder}worker-code.js`) ? false : 'no bundle: npm run build';

type Chunks = typeof CHUNKS;
type Run = (exports: object, require: (name: string) => object, load: (name: string) => Promise<object>) => void;

const chunks = async (): Promise<Chunks> => ((await import(`${folder}worker-code.js`)) as { CHUNKS: Chunks }).CHUNKS;
const namesIn = (text: string, call: string): string[] =>
  [...text.matchAll(new RegExp(`\\b${call}\\(["'\`]([^"'\`]+)["'\`]\\)`, 'g'))].map(([, name]) => name);

test('each chunk names what it needs and what it loads later, and nothing else', { skip }, async () => {
  const all = await chunks();
  const names = Object.keys(all);
  assert.ok(names.length > 20 && names.includes('./scene-worker.js'), names.join());
  const reached = new Set(['./scene-worker.js', ...names.flatMap((name) => all[name].needs)]);
  for (const name of names) {
    const { default: text } = await all[name].load();
    assert.ok(text.startsWith(`"${name}":(exports,require,gaussianSplatChunk)=>{`), `${name}: ${text.slice(0, 80)}`);
    assert.doesNotThrow(() => new Script(`({${text}})`), `${name} is a script, not a module`);
    const required = new Set([...all[name].needs, name]);
    assert.deepEqual(
      namesIn(text, 'require').filter((each) => !required.has(each)),
      [],
      `${name} requires`,
    );
    const loaded = namesIn(text, 'gaussianSplatChunk');
    assert.deepEqual(
      loaded.filter((each) => !names.includes(each)),
      [],
      `${name} loads`,
    );
    for (const each of loaded) reached.add(each);
  }
  // Names that no request matches are passed to a function of the test.
  assert.deepEqual(
    names.filter((name) => !reached.has(name)),
    [],
    'requested by no caller',
  );
});

test('the texts make the code of the worker: a reader of each format runs', { skip }, async () => {
  const all = await chunks();
  const made: Record<string, object> = {};
  const run: Record<string, Run> = {};
  const require = (name: string): object => {
    if (!made[name]) run[name]((made[name] = {}), require, load);
    return made[name];
  };
  const load = async (name: string): Promise<object> => {
    for (const each of [...all[name].needs, name]) {
      const { default: text } = await all[each].load();
      Object.assign(run, runInThisContext(`({${text}})`));
    }
    return require(name);
  };
  const worker = (await load('./scene-worker.js')) as { runOnPage: (...args: unknown[]) => Promise<unknown> };
  const skull = readFileSync(new URL('../../demo/scenes/skull.spz', import.meta.url));
  const url = `data:application/octet-stream;base64,${skull.toString('base64')}`;
  const request = { url, credentials: 'omit', sh: 'auto' };
  const scene = await worker.runOnPage('load', request, new AbortController().signal, { onProgress: () => undefined });
  assert.ok((scene as { packed: { count: number } }).packed.count > 10_000);
});

test('the script of that worker is one that can be parsed', () => {
  assert.doesNotThrow(() => new Function('early', `return ${BOOTSTRAP}`));
});

test('a chunk that two loads ask for at once is there for both', async () => {
  const texts: Record<string, string> = {
    './scene-worker.js': '"./scene-worker.js":(exports,require,load)=>{exports.load=load}',
    './reader.js': '"./reader.js":(exports)=>{exports.read=1}',
  };
  const sent = new Set<string>();
  const port: { onmessage?: (event: object) => void; postMessage: (question: { id: number; chunk: string }) => void } =
    {
      // Answers as the page does: sent data is not sent again.
      postMessage({ id, chunk }) {
        const wanted = sent.has(chunk) ? [] : [texts[chunk]];
        sent.add(chunk);
        setTimeout(() => port.onmessage?.({ data: { id, texts: wanted } }));
      },
    };
  class Text {
    readonly text: string;
    constructor(parts: readonly string[]) {
      this.text = parts.join('');
    }
  }
  const addresses = {
    createObjectURL: ({ text }: Text) =>
      `data:text/javascript,await new Promise((done) => setTimeout(done, 30));${encodeURIComponent(text)}`,
    revokeObjectURL: () => undefined,
  };
  const listen = (name: string, heard: (event: object) => void): void => {
    if (name === 'message') setTimeout(() => heard({ ports: [port] }));
  };
  const names = ['early', 'addEventListener', 'self', 'URL', 'Blob'];
  const start = new Function(...names, `return ${BOOTSTRAP}`) as (...values: unknown[]) => Promise<{
    load: (chunk: string) => Promise<{ read?: number }>;
  }>;
  const { load } = await start([], listen, globalThis, addresses, Text);
  const read = await Promise.all([load('./reader.js'), load('./reader.js')]);
  assert.deepEqual(
    read.map((module) => module.read),
    [1, 1],
  );
});
