/** Each stage alone, against a plain TypeScript twin, on Dawn in Node. The browser runs the same cases. */
import { after, test } from 'node:test';
import { someOf } from '../support/extent.js';
import { runCase } from '../support/gpu.js';
import { endNodeDevice, nodeDevice } from '../support/node-device.js';
import { stageCases } from './cases/index.js';

/** Every fourth case; all of them in the laboratory. */
for (const stageCase of someOf(stageCases, Math.ceil(stageCases.length / 4))) {
  test(stageCase.name, async () => runCase(await nodeDevice(), stageCase));
}

after(endNodeDevice);
