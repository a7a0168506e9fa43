import assert from 'node:assert/strict';
import { existsSync } from 'node:fs';
import { after, test } from 'node:test';
import { fileURLToPath } from 'node:url';

const built = fileURLToPath(new URL('../../packages/element/dist/loading/spawn-worker.js', import.meta.url));

test(
  'a module whose address is one on the disk, as webpack writes it, leaves the worker to the bundler',
  { skip: existsSync(built) ? false : 'not built' },
  async () => {
    const asked: string[] = [];
    const stand = {
      origin: 'https://page.example',
      Worker: class {
        constructor(url: URL | string) {
          asked.push(String(url));
        }
        addEventListener(): void {}
      },
    };
    for (const [name, value] of Object.entries(stand)) {
      Object.defineProperty(globalThis, name, { value, configurable: true });
    }
    after(() => Object.keys(stand).forEach((name) => Reflect.deleteProperty(globalThis, name)));
    const { spawnSceneWorker } = (await import(built)) as { spawnSceneWorker: () => unknown };
    spawnSceneWorker();
    assert.match(asked.join(), /^file:.*\/scene-worker\.js$/);
  },
);
