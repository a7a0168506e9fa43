/** Models and their files at addresses of all kinds, in Node: no device and no runtime are needed to open them. */
import assert from 'node:assert/strict';
import { createServer } from 'node:http';
import type { AddressInfo } from 'node:net';
import { test } from 'node:test';
import { checkModel } from '@gaussian-splat/check';
import { acquireSession, GaussianModels, openModel } from '@gaussian-splat/generator';
import { fixtureBytes } from '../support/generators.js';

/** A name of as many bytes as that in the fixture. Each of its signs has a meaning in a URL. */
const NAME = 'ext#r?al%weights';
const model = Buffer.from(
  Buffer.from(fixtureBytes('external.onnx')).toString('latin1').replaceAll('external.weights', NAME),
  'latin1',
);

test('the location of external data is the path of a file, also with characters that have a meaning in a URL', async () => {
  const files: Record<string, Uint8Array> = { '/model.onnx': model };
  files[`/${encodeURIComponent(NAME)}`] = fixtureBytes('external.weights');
  const server = createServer((request, response) => {
    const file = files[request.url ?? ''];
    if (file) response.end(file);
    else response.writeHead(404).end();
  });
  await new Promise<void>((resolve) => server.listen(0, '127.0.0.1', resolve));
  const url = `http://127.0.0.1:${(server.address() as AddressInfo).port}/model.onnx`;
  try {
    const { externalData } = await openModel({ url });
    assert.deepEqual(
      externalData.map(({ path, data }) => [path, data.length]),
      [[NAME, fixtureBytes('external.weights').length]],
    );
    assert.deepEqual((await checkModel(url, { run: true })).faults, []);
  } finally {
    server.closeAllConnections();
    server.close();
  }
});

test('a model without a folder has no external data, and says so', async () => {
  const url = `data:application/octet-stream;base64,${Buffer.from(fixtureBytes('external.onnx')).toString('base64')}`;
  await assert.rejects(openModel({ url }), { code: 'contract/external-data' });
});

test('an address that is none has the code of one', async () => {
  const lost = new Promise(() => undefined);
  await assert.rejects(acquireSession({ url: 'http://:80/a.onnx' }, { lost } as unknown as GPUDevice), {
    code: 'network/url',
  });
});

test('a sidecar that another server forbids to read counts as missing, unless the model needs one', async () => {
  const server = createServer((request, response) => {
    const name = (request.url ?? '').slice(1);
    if (name.endsWith('.onnx')) response.end(fixtureBytes(name));
    else request.socket.destroy();
  });
  await new Promise<void>((resolve) => server.listen(0, '127.0.0.1', resolve));
  const base = `http://127.0.0.1:${(server.address() as AddressInfo).port}`;
  try {
    assert.ok((await openModel({ url: `${base}/canonical.onnx` })).notes.length > 0);
    await assert.rejects(openModel({ url: `${base}/link.onnx` }), { code: 'network/unreachable' });
  } finally {
    server.closeAllConnections();
    server.close();
  }
});

test('a contract beside the model that a server cannot send now is asked for again, and never counts as missing', async () => {
  let [asked, failures] = [0, 2];
  const server = createServer((request, response) => {
    const name = (request.url ?? '').slice(1);
    if (name.endsWith('.onnx')) return response.end(fixtureBytes(name));
    asked++;
    if (asked <= failures) return response.writeHead(503).end();
    return response.writeHead(404).end();
  });
  await new Promise<void>((resolve) => server.listen(0, '127.0.0.1', resolve));
  const url = `http://127.0.0.1:${(server.address() as AddressInfo).port}/canonical.onnx`;
  try {
    assert.ok((await openModel({ url })).notes.length > 0);
    assert.equal(asked, 3);
    [asked, failures] = [0, Infinity];
    await assert.rejects(openModel({ url }), { code: 'network/status', message: /503/ });
    const { faults } = await checkModel(url);
    assert.deepEqual(
      faults.map(({ code }) => code),
      ['network/status'],
    );
  } finally {
    server.closeAllConnections();
    server.close();
  }
});

test('generators are loaded again for another device, as after the loss of the first one', async () => {
  let requests = 0;
  const server = createServer((_, response) => {
    requests++;
    response.end(fixtureBytes('packed.onnx'));
  });
  await new Promise<void>((resolve) => server.listen(0, '127.0.0.1', resolve));
  const models = new GaussianModels();
  models.registerGaussianGenerator('ball', {
    url: `http://127.0.0.1:${(server.address() as AddressInfo).port}/packed.onnx`,
  });
  const deviceOf = (): GPUDevice =>
    ({ lost: new Promise(() => undefined), limits: { maxBufferSize: 2 ** 28 }, queue: {} }) as unknown as GPUDevice;
  const first = deviceOf();
  const counts: number[] = [];
  for (const device of [first, first, deviceOf()]) {
    await models.loadAllGenerators(device);
    counts.push(requests);
  }
  server.closeAllConnections();
  server.close();
  models.clear();
  assert.ok(counts[0] === counts[1] && counts[2] === 2 * counts[0], counts.join());
});
