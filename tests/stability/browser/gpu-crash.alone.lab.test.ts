/**
 * S22, with a real crash: the browser's GPU process is killed.
 *
 * Passes: after the first crash the same image is back, with one pair of events, and no method returns an empty image meanwhile. After another within seconds Chromium has no device for some minutes:
 * the element says so, asks ever more rarely, and is back without a reload (whole runs only: it takes minutes, and later tests would have no GPU).
 */
import '@gaussian-splat/element';
import { executeServerCommand } from '@web/test-runner-commands';
import { assert, assertEqual, nextEvent, showLoaded, until } from '../../element/browser/support/harness.js';
import { isRed, screenOf } from '../../element/browser/support/screen.js';

/** Longest that Chromium has refused a page, seen: 155 s. */
const BLOCKED_MS = 400_000;

const kill = async (): Promise<void> =>
  assert(await executeServerCommand('kill-gpu-process'), 'there is a GPU process to be killed');

async function alphaOf(blob: Blob): Promise<number> {
  const bitmap = await createImageBitmap(blob);
  const context = new OffscreenCanvas(bitmap.width, bitmap.height).getContext('2d')!;
  context.drawImage(bitmap, 0, 0);
  return context
    .getImageData(0, 0, bitmap.width, bitmap.height)
    .data.reduce((sum, value, i) => sum + (i % 4 === 3 ? value : 0), 0);
}

describe('S22: a crash of the GPU process', () => {
  it('once: the frame is back, and none is empty', async () => {
    const element = await showLoaded();
    const expected = await alphaOf(await element.toBlob());
    const events: string[] = [];
    for (const type of ['contextlost', 'contextrestored', 'error', 'load'])
      element.addEventListener(type, () => events.push(type));
    const restored = nextEvent(element, 'contextrestored', 50_000);
    let isBack = false;
    void restored.then(() => (isBack = true));
    await kill();
    while (!isBack) {
      const blob = await element.toBlob().catch(() => undefined);
      if (blob) assertEqual(await alphaOf(blob), expected, 'alpha of a frame');
      await new Promise((resolve) => setTimeout(resolve, 20));
    }
    await restored;
    assertEqual(events, ['contextlost', 'contextrestored'], 'events');
    assert((await screenOf(element)).middleOf(isRed) !== null, 'the frame');
    if ((globalThis as { STABILITY?: string }).STABILITY !== 'full') return;
    await kill();
    await until(() => element.error !== null, 'what the element says', 60_000);
    assertEqual(element.error?.reason, 'device-lost/unrecoverable');
    await until(() => element.loaded, 'the frame, without a reload', BLOCKED_MS);
    assert((await screenOf(element)).middleOf(isRed) !== null, 'the frame');
  });
});
