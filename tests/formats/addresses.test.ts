/**
 * Which servers manifests may name files on: SECURITY.md has the rule.
 * SECURITY.md: "Manifests name files of their own server".
 */
import assert from 'node:assert/strict';
import { test } from 'node:test';
import { GaussianSplatError } from '@gaussian-splat/core';
import { fileRequest } from '@gaussian-splat/core/fetch';

const manifest = { url: 'https://x.test/a/scene.json?v=1', credentials: 'include' } as const;

test('files beside a manifest are asked for as it was', () => {
  const cases: [path: string, url: string][] = [
    ['b.spz', 'https://x.test/a/b.spz?v=1'],
    ['../b c.spz', 'https://x.test/b%20c.spz?v=1'],
    ['/b.spz?c', 'https://x.test/b.spz?c'],
    ['https://x.test/b.spz', 'https://x.test/b.spz?v=1'],
    ['//x.test/b.spz?c', 'https://x.test/b.spz?c'],
  ];
  for (const [path, url] of cases) assert.deepEqual(fileRequest(path, manifest), { url, credentials: 'include' });
});

test('other servers are refused, unless the page allows them; they get no cookies', () => {
  const others = [
    'https://y.test/b',
    '//y.test/b',
    '/\\\\y.test/b',
    '\t//y.test/b',
    'http://x.test/b',
    'https://x.test:444/b',
  ];
  const foreign = ['data:,b', 'javascript:alert(1)', 'file:///etc/passwd', 'blob:https://y.test/1-2', 'blob:x'];
  for (const path of [...others, ...foreign]) {
    assert.throws(
      () => fileRequest(path, manifest),
      /x\.test.*or on servers that the page allows.*decode\/unsupported/,
      path,
    );
  }
  const allowed = fileRequest('//y.test/b', manifest, ['https://y.test']);
  assert.deepEqual(allowed, { url: 'https://y.test/b', credentials: 'omit' });
  assert.throws(() => fileRequest('https://y.test.z/b', manifest, ['https://y.test']), GaussianSplatError);
});

test('a manifest that is a file of the page names whole addresses of its server', () => {
  const own = { url: 'blob:https://x.test/1-2', credentials: 'same-origin' } as const;
  assert.equal(fileRequest('https://x.test/b.spz', own).url, 'https://x.test/b.spz');
  for (const path of ['b.spz', 'https://y.test/b.spz'])
    assert.throws(() => fileRequest(path, own), /serve the manifest/i);
  const local = { url: 'file:///a/scene.json', credentials: 'omit' } as const;
  assert.equal(fileRequest('b.spz', local).url, 'file:///a/b.spz');
  assert.throws(() => fileRequest('https://x.test/b.spz', local), GaussianSplatError);
});
