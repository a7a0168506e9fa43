/**
 * Protection of pages whose visitors choose the scenes: no requests to other servers, no endless requests for missing files, no scenes beyond their limits.
 * SECURITY.md: "Pages set their own limits", "Manifests name files of their own server".
 */
import '@gaussian-splat/element';
import { GaussianSplatElement } from '@gaussian-splat/element';
import { itInLab } from '../../support/extent-in-pages.js';
import { assert, assertEqual, COMPASS, delay, nextEvent, show, until } from './support/harness.js';

const FOLDER = '/net/kept/addresses/';

/** Puts files on the server, which logs their requests. */
async function keep(files: Record<string, BodyInit>): Promise<void> {
  for (const [name, body] of Object.entries(files)) await fetch(FOLDER + name, { method: 'PUT', body });
}

async function asked(name: string): Promise<number> {
  const log = (await (await fetch(`${FOLDER}log`)).json()) as string[];
  return log.filter((path) => path === name).length;
}

const sequence = (frames: string[], framesPerSecond = 10): string =>
  JSON.stringify({ gaussianSplatSequence: 1, framesPerSecond, frames });

describe('untrusted scenes', () => {
  afterEach(() => {
    GaussianSplatElement.sceneLimits = {};
  });

  it('a sequence asks its own server alone, and those that the page allows', async () => {
    const ball = await (await fetch(COMPASS)).arrayBuffer();
    const foreign = `${await (await fetch('/net/other-origin')).text()}/fixtures/compass.splat`;
    await keep({ 'a.splat': ball, 'foreign.json': sequence(['a.splat', foreign, 'a.splat?2']) });
    const shown = async (): Promise<[string[], boolean]> => {
      const element = show({ src: `${FOLDER}foreign.json` });
      const reasons: string[] = [];
      element.addEventListener('generator-error', ({ detail }) => reasons.push(detail.reason));
      await element.ready;
      const seeked = nextEvent(element, 'seeked');
      element.currentTime = 0.15;
      await seeked;
      await delay(300);
      const { loaded } = element;
      element.remove();
      return [reasons, loaded];
    };
    assertEqual(await shown(), [['decode/unsupported'], true], 'a frame on another server');
    GaussianSplatElement.sceneLimits = { origins: [new URL(foreign).origin] };
    assertEqual(await shown(), [[], true], 'one that the page allows');
  });

  itInLab('a missing frame is requested at growing intervals, and reported once', async () => {
    const ball = await (await fetch(COMPASS)).arrayBuffer();
    await keep({ 'b.splat': ball, 'missing.json': sequence(['b.splat', 'none.splat', 'b.splat?2'], 20) });
    const element = show({ src: `${FOLDER}missing.json`, loop: '' });
    // The next frame is requested before the first one is visible.
    let errors = 0;
    element.addEventListener('generator-error', () => errors++);
    await element.ready;
    await element.play();
    let [rounds, last] = [0, 0];
    await until(() => {
      if (element.currentTime < last) rounds++;
      last = element.currentTime;
      return rounds >= 20;
    }, 'twenty rounds');
    element.pause();
    const requests = await asked('none.splat');
    assert(requests >= 1 && requests <= 4, `${requests} requests in twenty rounds`);
    assertEqual(errors, 1, 'errors');
  });

  it('limits of the page refuse a scene by name', async () => {
    const refused = async (limits: typeof GaussianSplatElement.sceneLimits, src = COMPASS): Promise<string> => {
      GaussianSplatElement.sceneLimits = limits;
      const element = show({ src });
      await element.ready;
      const reason = element.error?.reason ?? 'none';
      element.remove();
      return reason;
    };
    assertEqual(await refused({ maxSplats: 5 }), 'out-of-memory/budget', 'splats');
    assertEqual(await refused({ maxBytes: 300 }), 'out-of-memory/budget', 'bytes');
    const slow = '/net/slow/compass.splat?ms=8000';
    assertEqual(await refused({ maxSeconds: 0.5 }, slow), 'out-of-memory/budget', 'seconds');
    assertEqual(await refused({ maxSplats: 1e6, maxBytes: 1e9, maxSeconds: 60 }), 'none', 'enough of all');
  });
});
