/** Files behind doors, fetched before they are needed. */
import assert from 'node:assert/strict';
import { test } from 'node:test';
import { GaussianSplatError } from '@gaussian-splat/core';
import { Ahead } from '../../packages/element/src/features/doors/ahead.js';

const addressOf = (name: string): string => `https://rooms.example/${name}.spz`;

/** A server that counts requests: those of `sizes` are answered at once, in bytes; others when the test says. */
function server(sizes: Record<string, number>) {
  const asked: string[] = [];
  const waiting = new Map<string, (bytes: number) => void>();
  const fetch = async (url: string, signal: AbortSignal): Promise<ArrayBuffer> => {
    const name = new URL(url).pathname.slice(1, -4);
    asked.push(name);
    const size = sizes[name] ?? (await new Promise<number>((resolve) => waiting.set(name, resolve)));
    signal.throwIfAborted();
    if (size > 0) return new ArrayBuffer(size);
    throw new GaussianSplatError('network/status', { where: url, expected: 'a file', found: '404', remedy: 'none' });
  };
  return { asked, waiting, fetch };
}

const noProgress = (): void => undefined;
const settled = (): Promise<void> => new Promise((resolve) => setTimeout(resolve, 20));

test('files that do not fit together are fetched once each, and the last ones are kept', async () => {
  const { asked, fetch } = server({ small: 1e3, d: 40e6, e: 40e6 });
  const ahead = new Ahead((error) => assert.fail(error));
  ahead.want(['small', 'd', 'e'].map(addressOf), fetch);
  await settled();
  assert.deepEqual(asked, ['small', 'd', 'e']);
  // Wanted again, as after a change of the children: nothing more to do.
  ahead.want(['small', 'd', 'e'].map(addressOf), fetch);
  await settled();
  assert.deepEqual(asked, ['small', 'd', 'e']);
  assert.equal(await ahead.take(addressOf('d'), noProgress), undefined);
  assert.equal((await ahead.take(addressOf('e'), noProgress))!.size, 40e6);
});

test('a file that fails keeps no other from being fetched, and is tried again in another room', async () => {
  const { asked, fetch } = server({ lost: 0, b: 10 });
  const warnings: string[] = [];
  const ahead = new Ahead(({ message }: Error) => warnings.push(message));
  ahead.want(['lost', 'b'].map(addressOf), fetch);
  await settled();
  assert.deepEqual(asked, ['lost', 'b']);
  assert.equal(warnings.length, 1);
  ahead.want([addressOf('lost')], fetch);
  await settled();
  assert.deepEqual(asked, ['lost', 'b', 'lost']);
});

test('a download continues while it is wanted, or taken; another choice stops it', async () => {
  const { asked, waiting, fetch } = server({ b: 10 });
  const ahead = new Ahead((error) => assert.fail(error));
  ahead.want(['slow', 'b'].map(addressOf), fetch);
  await settled();
  ahead.want(['b', 'slow'].map(addressOf), fetch);
  const taken = ahead.take(addressOf('slow'), () => undefined);
  waiting.get('slow')!(20);
  assert.equal((await taken)!.name, 'slow.spz');
  await settled();
  assert.deepEqual(asked, ['slow'], 'nothing else is fetched while a visitor waits');
  ahead.want([addressOf('other')], fetch);
  await settled();
  assert.equal(await ahead.take(addressOf('b'), noProgress), undefined);
  waiting.get('other')!(30);
  await settled();
  assert.equal(await ahead.take(addressOf('other'), noProgress), undefined, 'stopped');
});
