/** SECURITY.md: "No text becomes markup", "A strict Content-Security-Policy is enough". */
import type { GaussianSplatElement } from '@gaussian-splat/element';
import { itInLab } from '../../support/extent-in-pages.js';
import { assert, assertEqual, COMPASS, FIXTURES, nextEvent, show, until } from './support/harness.js';
import { isRed, screenOf } from './support/screen.js';

/** Scripts of all workers that the page has started. */
const workers: string[] = [];
window.Worker = class extends Worker {
  constructor(script: string | URL, options?: WorkerOptions) {
    super(script, options);
    workers.push(String(script));
  }
};

describe('the CDN build', () => {
  it('from another origin finds its worker and its readers', async () => {
    const origin = await (await fetch('/net/other-origin')).text();
    const { GaussianSplatElement: Class } = (await import(`${origin}/cdn/gaussian-splat.min.js`)) as {
      GaussianSplatElement: typeof GaussianSplatElement;
    };
    assert(customElements.get('gaussian-splat') === Class, "the element is the build's");
    // At the same time: a worker that is not used for a while ends.
    for (const element of [show({ src: COMPASS }), show({ src: COMPASS.replace('.splat', '.ply') })]) {
      await element.ready;
      assert(element.loaded, element.error?.message ?? 'not loaded');
      assert((await screenOf(element)).middleOf(isRed), 'the scene is seen');
    }
    assert(workers.length === 1 && workers[0].startsWith('blob:'), `one worker by way of a blob: ${workers.join(' ')}`);
  });

  itInLab(
    'keeps its worker in a sandboxed frame, whose origin is none, as editors of code on the web have them',
    async () => {
      const origin = await (await fetch('/net/other-origin')).text();
      const page = await (await fetch(`${FIXTURES}sandboxed.html`)).text();
      const places = { src: `${origin}/fixtures/sandboxed.html`, srcdoc: `<base href="${origin}/fixtures/" />${page}` };
      for (const [name, value] of Object.entries(places)) {
        const frame = document.createElement('iframe');
        frame.sandbox.add('allow-scripts');
        frame.setAttribute(name, value);
        const answer = nextEvent<MessageEvent<Record<string, unknown>>>(window, 'message');
        document.body.append(frame);
        const { data } = await answer;
        assertEqual([data.error, data.loaded, data.warnings, data.origin], [undefined, true, [], 'null'], name);
      }
    },
  );

  it('fetches from there what streamed scenes, sequences and refused files need, and only for them', async () => {
    const origin = await (await fetch('/net/other-origin')).text();
    await import(`${origin}/cdn/gaussian-splat.min.js`);
    const parts = (): string[] =>
      performance
        .getEntriesByType('resource')
        .map(({ name }) => name)
        // The code of dynamic quality is fetched as soon as the first frame is drawn.
        .filter(
          (name) => name.startsWith(`${origin}/cdn/`) && /cdn\/(?!dynamic-quality)[^/]*-[\w-]{8}\.js$/.test(name),
        );
    const shown = async (src: string): Promise<GaussianSplatElement> => {
      const element = show({ src });
      await element.ready;
      return element;
    };
    assert((await shown(COMPASS.replace('.splat', '.ply'))).loaded, 'a PLY file is shown');
    // The self-test of the GPU with the code that packs its splats (`sh`), the counts of frames, printing, and on a first visit the search for what suits the GPU. Its result is stored.
    await until(() => Object.keys(localStorage).some((key) => key.startsWith('gaussian-splat ')), 'a choice is kept');
    const first = parts().length;
    const expected = /cdn\/(timing|sh|frame-stats|print-controller|search)-/;
    const others = parts().filter((part) => !expected.test(part));
    assertEqual(others, [], 'further parts fetched for a PLY file');
    assert((await shown(COMPASS)).loaded, 'another is shown');
    const refused = await shown(`${FIXTURES}lfs-pointer.ply`);
    assertEqual(refused.error?.reason, 'decode/lfs-pointer', 'a file that is no scene');
    assertEqual(parts().length - first, 0, 'parts that the page fetched for it and for another scene');
    // The manifest is fetched by the part of the element that reads it.
    assertEqual((await shown('/nowhere/detail.json')).error?.reason, 'network/status', 'a streamed scene');
    assertEqual(parts().length - first, 5, 'parts for a streamed scene, two of them for sequences too');
    const sequence = await shown('/net/sequence/movie.json');
    assertEqual([sequence.error, sequence.duration], [null, 1.2], 'error and duration of a sequence');
    assertEqual(parts().length - first, 7, 'parts for a sequence, one of them for all that moves');
  });

  it('shows the children of its elements on a page that also has another copy of the package', async () => {
    const origin = await (await fetch('/net/other-origin')).text();
    await import(`${origin}/cdn/gaussian-splat.min.js`);
    const { GaussianSplatElement: Other } = await import('@gaussian-splat/element');
    await import('@gaussian-splat/element/scenes.js');
    assert(customElements.get('gaussian-splat') !== Other, 'the element is that of the other copy');
    const element = show({ alt: 'Two copies' });
    element.innerHTML = `<splat-scene src="${COMPASS}"></splat-scene>`;
    await until(() => element.querySelector('splat-scene')!.loaded === true, 'the child');
    assert((await screenOf(element)).middleOf(isRed), 'the child is seen');
  });

  it('on a page that refuses workers and inline styles reads on the main thread, with one warning', async () => {
    const frame = document.createElement('iframe');
    const answer = nextEvent<MessageEvent<Record<string, unknown>>>(window, 'message');
    frame.src = '/net/strict-page';
    frame.style.cssText = 'width: 400px; height: 300px';
    document.body.append(frame);
    const { data } = await answer;
    assertEqual([data.loaded, data.error], [true, undefined], 'loaded');
    assertEqual((data.warnings as string[]).length, 1, `warnings ${JSON.stringify(data.warnings)}`);
    assert(/worker-src/.test(String(data.warnings)), String(data.warnings));
    assertEqual(data.violations, ['worker-src'], 'violations of the policy');
  });

  /** Messages of a page within a frame. */
  async function reportOf(address: string): Promise<Record<string, unknown>> {
    const frame = document.createElement('iframe');
    const answer = nextEvent<MessageEvent<Record<string, unknown>>>(window, 'message', 60_000);
    frame.src = address;
    frame.style.cssText = 'width: 400px; height: 300px';
    document.body.append(frame);
    return (await answer).data;
  }

  it('under the policy of the README, Trusted Types included, violates nothing and keeps its worker', async () => {
    const report = await reportOf('/net/secure-page');
    assertEqual([report.loaded, report.error, report.prompt], [true, undefined, true], 'loaded, error, prompt');
    assertEqual([report.violations, report.warnings], [[], []], 'violations and warnings');
  });

  itInLab("shows textured meshes there, and compressed ones with 'wasm-unsafe-eval'", async () => {
    const textured = await reportOf(`/net/secure-page?mesh=${FIXTURES}textured.glb`);
    assertEqual([textured.loaded, textured.mesh], [true, [true, null]], 'a texture within a GLB');
    assertEqual([textured.violations, textured.warnings], [[], []], 'violations and warnings');
    for (const file of ['meshopt.glb', 'draco.glb', 'ktx2.glb']) {
      const shown = await reportOf(`/net/secure-page?wasm&mesh=${FIXTURES}${file}`);
      assertEqual([shown.mesh, shown.violations], [[true, null], []], file);
      // A worker of this origin has the policy that comes with its script: without a worker, the page's own counts.
      const { mesh } = await reportOf(`/net/secure-page?noworker&mesh=${FIXTURES}${file}`);
      const [isShown, message] = mesh as [boolean, string | null];
      assert(!isShown && /allow 'wasm-unsafe-eval'/i.test(String(message)), `${file} is refused by name: ${message}`);
    }
  });

  itInLab("runs a generator there with 'wasm-unsafe-eval', and nothing more", async () => {
    const report = await reportOf('/net/secure-page?generator');
    assertEqual([report.loaded, report.error], [true, undefined], 'loaded');
    assertEqual(report.violations, [], 'violations');
  });

  itInLab('takes what a page has put into globalThis.GaussianSplatElement', async () => {
    const frame = document.createElement('iframe');
    frame.srcdoc = `<!doctype html><title>Configured</title>
      <script>
        globalThis.GaussianSplatElement = { memoryBudget: 1, releaseDelay: 7, runtimeLocation: '/elsewhere/', urlModifier: () => '${location.origin}${COMPASS}' };
      </script>
      <script type="module">
        const { GaussianSplatElement: Class } = await import('/packages/element/cdn/gaussian-splat.min.js');
        const element = document.querySelector('gaussian-splat');
        await element.ready;
        parent.postMessage({ delay: Class.releaseDelay, runtime: Class.runtimeLocation, reason: element.error?.reason }, '*');
      </script>
      <gaussian-splat src="nowhere.splat" loading="eager"></gaussian-splat>`;
    const answer = nextEvent<MessageEvent<Record<string, unknown>>>(window, 'message', 60_000);
    document.body.append(frame);
    const { data } = await answer;
    assertEqual([data.delay, data.runtime], [7, '/elsewhere/'], 'releaseDelay, runtimeLocation');
    // The loader finds it at urlModifier's address, and the budget then refuses it.
    assertEqual(data.reason, 'out-of-memory/budget', 'reason');
  });

  it('is one tag with integrity on a page of another origin, generators included, without isolation', async () => {
    const report = await reportOf('/net/cdn-page');
    assertEqual(
      [report.loaded, report.errors],
      [
        [true, true],
        [null, null],
      ],
      'loaded',
    );
    assertEqual(report.isolated, false, 'cross-origin isolated');
    const other = await (await fetch('/net/other-origin')).text();
    const scripts = report.scripts as string[];
    assert(scripts.length >= 4, `scripts: ${scripts.join(' ')}`);
    assertEqual(
      scripts.filter((name) => !name.startsWith(other)),
      [],
      'scripts from elsewhere',
    );
    console.log(`navigation to defined: ${Math.round(Number(report.definedMs))} ms`);
  });
});
