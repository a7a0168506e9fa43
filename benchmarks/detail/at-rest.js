/** Views of a streamed scene at rest: their final state, and its PSNR against a frame with more splats. */
import { readPixels } from '../run/read-pixels.js';
import { flightCamera } from './flight-path.js';
import { drawn, rounded } from './second.js';

/**
 * Draws one view until no more pages arrive, or until a time limit, because a pool that is too small for a view keeps
 * exchanging pages for a while.
 * @returns seconds taken, and pages in transit at the end: 0 if the view has all pages that it can get
 */
async function settle({ device, viewpoint, scene, target, turn, progress, settleSeconds }, camera, settings) {
  const start = performance.now();
  const took = () => (performance.now() - start) / 1000;
  for (let calm = 0; calm < 20 && took() < Math.min(settleSeconds, progress.left);) {
    const { resident } = scene.progress;
    viewpoint.draw(camera, { target }, settings);
    await drawn(device);
    await turn();
    calm = scene.progress.resident === resident && scene.progress.coming === 0 ? calm + 1 : 0;
  }
  return { seconds: rounded(took()), coming: scene.progress.coming };
}

/** PSNR over the pixels that either frame covers; `identical` for equal frames, `empty` if neither covers any. */
function psnr(a, b) {
  let [sum, count] = [0, 0];
  for (let i = 0; i < a.length; i += 4) {
    if (a[i + 3] === 0 && b[i + 3] === 0) continue;
    for (let k = 0; k < 4; k++) sum += (a[i + k] - b[i + k]) ** 2;
    count += 4;
  }
  if (count === 0) return 'empty';
  return sum === 0 ? 'identical' : rounded(-10 * Math.log10(sum / count));
}

/**
 * Compares the frame of each view within the budget with one of a quarter of the error and four times the budget.
 * @param shares fractions of the flight's curve, before each view
 * @param views gets a row for each
 */
export async function compare(all, shares, views) {
  const { manifest, width, height, settings, progress } = all;
  const { detail, splatBudget } = settings;
  for (const share of shares) {
    if (progress.left === 0) throw new Error('the time was up');
    const camera = flightCamera(share, { bounds: manifest.bounds, width, height });
    progress.begin(`the view at ${share} of the flight`);
    const settled = await settle(all, camera, settings);
    const image = await readPixels(all.device, all.target);
    const { visible, budgetError } = await all.viewpoint.stats();
    const { resident, error } = all.scene.progress;
    const rest = { resident, poolError: rounded(error) };
    progress.begin(`the view at ${share} of the flight, four times finer`);
    const finerSettled = await settle(all, camera, { ...settings, detail: detail / 4, splatBudget: 4 * splatBudget });
    const finer = await readPixels(all.device, all.target);
    const more = await all.viewpoint.stats();
    views.push({
      ...{ share, settled, visible, budgetError: rounded(budgetError), ...rest },
      against: {
        settled: finerSettled,
        visible: more.visible,
        budgetError: rounded(more.budgetError),
        overflow: more.overflow,
        decibels: psnr(image, finer),
      },
    });
  }
}
