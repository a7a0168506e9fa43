import { assertShown, open } from './support.js';

describe('the page of trained examples', () => {
  it('the skull runs on the GPU, is drawn, and reports its cost', async () => {
    await assertShown(await open('skull'), 79_995);
  }).timeout(230_000);
});
