/** Every stage alone, against a plain TypeScript twin, on Dawn in Node. The browser runs the same cases. */
import { after, test } from 'node:test';
import { runCase } from '../support/gpu.js';
import { endNodeDevice, nodeDevice } from '../support/node-device.js';
import { stageCases } from './cases/index.js';

for (const stageCase of stageCases) {
  test(stageCase.name, async () => runCase(await nodeDevice(), stageCase));
}

after(endNodeDevice);
