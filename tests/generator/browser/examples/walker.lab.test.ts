import { assertShown, changes, open, slide } from './support.js';

describe('the page of trained examples', () => {
  it('the walker runs on the GPU, is drawn, reports its cost, and follows its pose and shape', async () => {
    const walker = await open('walker');
    await assertShown(walker, 40_000);
    await changes(walker.element, () => slide(walker.card, '[data-handle="arms"]', 1), 'arms');
    await changes(walker.element, () => slide(walker.card, '[data-shape]', 0.8), 'shape');
  }).timeout(230_000);
});
