import { assert, assertEqual, until } from '../../../element/browser/support/harness.js';
import { assertShown, changes, open, slide } from './support.js';

describe('the page of trained examples', () => {
  it('the plant runs on the GPU, is drawn, reports its cost, and follows its time', async () => {
    const plant = await open('plant');
    await assertShown(plant, 30_000);
    await changes(plant.element, () => slide(plant.card, '[data-time]', 2.5), 'time');
    assertEqual([plant.element.currentTime, plant.element.duration], [2.5, 6]);
    await assertOilReported(plant.page);
  }).timeout(230_000);
});

/** The post-processor, which writes no Gaussians, shows its cost beside its image. */
async function assertOilReported(page: Document): Promise<void> {
  const card = page.querySelector<HTMLElement>('[data-example="oil"]')!;
  await until(() => card.querySelector('.cost')!.childElementCount > 0, 'its cost');
  const words = card.querySelector('.cost')!.textContent!;
  assert(words.includes('0.09 MB') && words.includes('28.2 dB') && !words.includes('Gaussians'), words);
  const image = card.querySelector('img')!;
  await image.decode();
  assert(image.naturalWidth > 100, 'its frame');
}
