/** The playground as a person uses it: its fields become attributes, and its HTML, pasted into another page, does the same there. */
import assert from 'node:assert/strict';
import { after, before, describe, it } from 'node:test';
import { readFileSync } from 'node:fs';
import type { Page } from 'playwright-core';
import { checkPage } from './page-check.js';
import { isBuilt, openSite, root, withCompass, type OpenSite, type Visit } from './support.js';

interface Splat extends Element {
  readonly loaded: boolean;
  readonly error: { readonly message: string } | null;
  readonly stats: { readonly splats: number };
  getCameraOrbit(): object;
  getFieldOfView(): object;
  jumpCameraToGoal(): void;
}
const TIMEOUT = { timeout: 100_000, polling: 100 };
const COMPASS = '/fixtures/compass.splat';

const loaded = (tab: Page): Promise<unknown> =>
  tab.waitForFunction(() => document.querySelector<Splat>('gaussian-splat')?.loaded, undefined, TIMEOUT);

/** Attributes of a page's scene, and its camera position. */
const stateOf = (tab: Page): Promise<{ attributes: Record<string, string>; view: string[] }> =>
  tab.evaluate(() => {
    const scene = document.querySelector<Splat>('gaussian-splat')!;
    scene.jumpCameraToGoal();
    const attributes = [...scene.attributes].filter(({ name }) => !['id', 'src', 'style'].includes(name));
    return {
      attributes: Object.fromEntries(attributes.map(({ name, value }) => [name, value])),
      view: [String(scene.getCameraOrbit()), String(scene.getFieldOfView())],
    };
  });

/** A .splat file: a square floor, 4 on each side, whose upright is `up` (of length 1), and nothing else. */
function floorOf(up: readonly [number, number, number]): Buffer {
  const [x, y, z] = up;
  const across = [Math.hypot(y, z), (-x * y) / Math.hypot(y, z), (-x * z) / Math.hypot(y, z)];
  const along = [y * across[2] - z * across[1], z * across[0] - x * across[2], x * across[1] - y * across[0]];
  const side = 41;
  const bytes = Buffer.alloc(32 * side * side);
  for (let i = 0; i < side * side; i++) {
    const [a, b] = [(i % side) / 10 - 2, Math.floor(i / side) / 10 - 2];
    [0, 1, 2].forEach((k) => {
      bytes.writeFloatLE(a * across[k] + b * along[k], 32 * i + 4 * k);
      bytes.writeFloatLE(0.06, 32 * i + 12 + 4 * k);
    });
    bytes.set([200, 180, 150, 255, 255, 128, 128, 128], 32 * i + 24);
  }
  return bytes;
}

describe('the playground', { skip: isBuilt ? false : 'no site: npm run build' }, () => {
  let open: OpenSite;
  let visit: Visit;
  before(async () => {
    open = await openSite();
    visit = await open.visit(`/playground/?src=${COMPASS}&camera-controls=`, {
      width: 240,
      height: 400,
      prepare: withCompass,
    });
  });
  after(() => open.close());

  it('writes HTML that does elsewhere what it does here', { timeout: 120_000 }, async () => {
    const { tab, faults } = visit;
    await loaded(tab);
    await tab.locator('summary', { hasText: 'Quality' }).click();
    await tab.fill('#attribute-alt', 'A compass, "painted" <by> me & you');
    // Another quality would have other shaders, on both pages: only the attribute is tested.
    await tab.selectOption('#attribute-quality', 'default');
    await tab.fill('#attribute-max-sh-degree', '1');
    await tab.fill('#attribute-camera-orbit', '40deg 60deg 120%');
    await tab.fill('#attribute-field-of-view', '33deg');
    await tab.fill('#attribute-interpolation-decay', '0');
    await tab.locator('#attribute-interpolation-decay').blur();
    const here = await stateOf(tab);
    assert.equal(here.attributes.quality, 'default');
    const html = (await tab.locator('#html').textContent())!;
    await tab.locator('summary', { hasText: 'Generators' }).click();
    await tab.fill('#attribute-chain', ' /a.onnx  b.onnx ');
    await tab.locator('#attribute-chain').blur();
    const { origin, href } = new URL(tab.url());
    const addresses = `${origin}/a.onnx ${new URL('b.onnx', href).href}`;
    assert.ok((await tab.locator('#html').textContent())!.includes(`chain="${addresses}"`), 'each address separately');
    assert.match(
      html,
      /^<script type="module" src="http:[^"]+\/cdn\/gaussian-splat\.min\.js"><\/script>\n<gaussian-splat/,
    );

    const { tab: page, faults: others } = await open.visit('/docs/', { width: 240, height: 400 });
    const address = new URL('/pasted.html', page.url()).href;
    const body = `<!doctype html><title>Pasted</title><link rel="icon" href="data:,"><style>gaussian-splat { width: 208px; height: 156px }</style>${html}`;
    await page.route(address, (route) => route.fulfill({ contentType: 'text/html', body }));
    await page.goto(address);
    await loaded(page);
    assert.deepEqual(await stateOf(page), here);
    assert.deepEqual([faults, others], [[], []]);
    await page.close();
  });

  it('copies the view, opens a file of the visitor, and starts over', { timeout: 120_000 }, async () => {
    const { tab, faults } = visit;
    await tab.click('#reset');
    await tab.evaluate(() => scrollTo(0, 0));
    await loaded(tab);
    await tab.evaluate(() => document.querySelector<HTMLElement>('gaussian-splat')!.focus());
    await tab.keyboard.press('ArrowRight');
    await tab.click('#copy-view');
    const { view } = await stateOf(tab);
    const copied = /camera-orbit="(-?[\d.]+)deg (-?[\d.]+)deg ([\d.]+)%"/.exec(
      (await tab.locator('#html').textContent())!,
    );
    const [theta, phi, radius] = view[0].split(' ').map(parseFloat);
    const framing = await tab.evaluate(() => document.querySelector('gaussian-splat')!.getCameraOrbit().framingRadius);
    // In percent of what frames the scene, the view fits a phone, too.
    const wanted = [(theta * 180) / Math.PI, (phi * 180) / Math.PI, (100 * radius) / framing];
    assert.ok(Math.abs(theta) > 0.01, 'the key has turned it');
    wanted.forEach((value, i) =>
      assert.ok(Math.abs(Number(copied?.[i + 1]) - value) < 0.06, `${copied?.[0]}, ${wanted}`),
    );

    const buffer = readFileSync(`${root}tests/element/browser/fixtures/compass.ply`);
    const file = { name: 'mine & yours.ply', mimeType: '', buffer };
    await tab.setInputFiles('#drop input', file);
    await tab.waitForFunction(() => /^Loading|splats/.test(document.getElementById('status')!.textContent!));
    await loaded(tab);
    const html = await tab.locator('#html').textContent();
    assert.match(
      html!,
      /<gaussian-splat\s+src="mine &amp; yours\.ply"\s+camera-controls\s+style="[^"]+"\s*><\/gaussian-splat>/,
    );
    assert.match(await tab.evaluate(() => document.querySelector('gaussian-splat')!.getAttribute('src')!), /^blob:/);

    await tab.click('#reset');
    assert.match(
      (await tab.locator('#html').textContent())!,
      /scenes\/skull\.spz"\s+alt="A skull"\s+camera-controls\s+style="[^"]+"\s*>/,
    );
    assert.deepEqual(faults, []);
  });

  it('sets a tilted capture upright by three points of its floor', { timeout: 120_000 }, async () => {
    const { tab, faults } = visit;
    const up = [0.2, -0.9, 0.3].map((value) => value / Math.hypot(0.2, 0.9, 0.3)) as [number, number, number];
    await tab.click('#reset');
    await tab.setInputFiles('#drop input', { name: 'floor.splat', mimeType: '', buffer: floorOf(up) });
    await tab.waitForFunction(() => document.querySelector('gaussian-splat')!.getAttribute('src')?.startsWith('blob:'));
    await loaded(tab);
    await tab.waitForFunction(() => !document.querySelector<HTMLButtonElement>('#level')!.disabled);
    // From far above: from the side a tilted floor is but an edge.
    await tab.fill('#attribute-camera-orbit', '0deg 30deg auto');
    await tab.locator('#attribute-camera-orbit').blur();
    await tab.click('#level');
    await tab.locator('gaussian-splat').scrollIntoViewIfNeeded();
    const box = (await tab.locator('gaussian-splat').boundingBox())!;
    const said = tab.locator('#copied');
    const answers: string[] = [];
    for (const [x, y] of [
      [0.02, 0.02],
      [0.3, 0.5],
      [0.7, 0.45],
      [0.5, 0.7],
    ]) {
      const before = await said.textContent();
      await tab.mouse.click(box.x + x * box.width, box.y + y * box.height);
      await tab.waitForFunction((old) => document.getElementById('copied')!.textContent !== old, before, TIMEOUT);
      answers.push((await said.textContent())!.slice(0, 9));
      // Two at one place within half a second are a double click, which turns the camera to it.
      await tab.waitForTimeout(600);
    }
    assert.deepEqual(answers, ['There is ', 'Two more.', 'One more.', 'Upright. ']);
    const found = (await tab.inputValue('#attribute-up')).split(' ').map(Number);
    const angle =
      (Math.acos(
        Math.min(
          1,
          found.reduce((sum, value, k) => sum + value * up[k], 0),
        ),
      ) *
        180) /
      Math.PI;
    assert.ok(angle < 2, `${found.join(' ')} is ${angle} degrees from upright`);
    assert.ok((await tab.locator('#html').textContent())!.includes(`up="${found.join(' ')}"`), 'the HTML says so');
    assert.deepEqual(faults, []);
  });

  it('says what is wrong with a value, and leaves it out', { timeout: 120_000 }, async () => {
    const { tab, faults } = visit;
    await tab.click('#reset');
    await tab.fill('#attribute-camera-orbit', 'banana');
    const fault = tab.locator('#attribute-camera-orbit-fault');
    assert.match((await fault.textContent())!, /^Not used: expected .+, found "banana"\.$/);
    assert.equal(await tab.getAttribute('#attribute-camera-orbit', 'aria-invalid'), 'true');
    assert.doesNotMatch((await tab.locator('#html').textContent())!, /banana/);
    await tab.locator('input[data-of="camera-orbit"][data-part="0"]').fill('90');
    assert.equal(await tab.inputValue('#attribute-camera-orbit'), '90deg 75deg 100%');
    assert.equal(await fault.count(), 0);
    assert.deepEqual(faults, []);
  });

  it('takes a file dropped anywhere, and puts a label and a view into the HTML', { timeout: 120_000 }, async () => {
    const { tab, faults } = visit;
    const bytes = [...floorOf([0, -1, 0])];
    await tab.evaluate((all) => {
      const data = new DataTransfer();
      data.items.add(new File([new Uint8Array(all)], 'dropped.splat'));
      document.querySelector('h1')!.dispatchEvent(new DragEvent('drop', { bubbles: true, dataTransfer: data }));
    }, bytes);
    await tab.waitForFunction(() =>
      document.querySelector('gaussian-splat')!.getAttribute('src')?.endsWith('dropped.splat'),
    );
    await loaded(tab);
    await tab.fill('#attribute-camera-orbit', '0deg 30deg auto');
    await tab.waitForFunction(() => !document.querySelector<HTMLButtonElement>('#add-label')!.disabled);
    await tab.click('#add-label');
    await tab.locator('gaussian-splat').scrollIntoViewIfNeeded();
    const box = (await tab.locator('gaussian-splat').boundingBox())!;
    await tab.mouse.click(box.x + box.width / 2, box.y + box.height / 2);
    await tab.locator('#children input').first().waitFor({ timeout: 60_000 });
    await tab.locator('#children input').first().fill('The <floor>');
    await tab.click('#add-view');
    const html = (await tab.locator('#html').textContent())!;
    assert.match(html, /<button slot="hotspot-1"\s+data-position="[^"]+"\s*>The &lt;floor><\/button>/);
    assert.match(
      html,
      /<button slot="view"\s+data-orbit="[^"]+"\s+data-target="[^"]+"\s+data-field-of-view="[^"]+"\s*>View 2<\/button>/,
    );
    const [page] = await Promise.all([tab.waitForEvent('download'), tab.click('#save-page')]);
    const saved = readFileSync(await page.path(), 'utf8');
    assert.ok(saved.startsWith('<!doctype html>') && saved.includes('src="dropped.splat"'), saved);
    assert.match(tab.url(), /file=dropped\.splat/);
    assert.deepEqual(faults, []);
  });

  it('crops a scene by the sides of a box, in the HTML, the link and the frame too', { timeout: 120_000 }, async () => {
    const { tab, faults } = visit;
    await tab.click('#reset');
    await tab.setInputFiles('#drop input', { name: 'floor.splat', mimeType: '', buffer: floorOf([0, -1, 0]) });
    /** Waits until the box around the remaining splats is this one. */
    const boxIs = (wanted: number[]): Promise<unknown> =>
      tab.waitForFunction(
        (sides) => {
          const box = document.querySelector('gaussian-splat')!.getBoundingBox();
          const found = box && [box.min.x, box.max.x, box.min.z, box.max.z];
          return found?.every((value, i) => Math.abs(value - sides[i]) < 0.2);
        },
        wanted,
        TIMEOUT,
      );
    await boxIs([-2, 2, -2, 2]);
    await tab.locator('summary', { hasText: 'Crop' }).click();
    await tab.waitForFunction(() => !document.querySelector<HTMLInputElement>('[data-side=right]')!.disabled);
    await tab.evaluate(() => document.querySelector<HTMLElement>('gaussian-splat')!.focus());
    await tab.keyboard.press('ArrowRight');
    // The camera glides to its rest.
    let [turned] = (await stateOf(tab)).view;
    for (let before = ''; before !== turned; [turned] = (await stateOf(tab)).view) {
      before = turned;
      await tab.waitForTimeout(500);
    }
    await tab.locator('[data-side=right]').fill('25');
    await boxIs([-2, -1, -2, 2]);
    await tab.waitForFunction(
      (wanted) => String(document.querySelector<Splat>('gaussian-splat')!.getCameraOrbit()) === wanted,
      turned,
      TIMEOUT,
    );
    // A side at the end of its slider is far out: nothing of a sky goes.
    assert.ok(Number((await tab.inputValue('#attribute-crop')).split(' ')[0]) < -100);
    // Towards the camera: z of viewer space, and -z of the file.
    await tab.locator('[data-side=front]').fill('50');
    await boxIs([-2, -1, -2, 0]);
    const text = await tab.inputValue('#attribute-crop');
    const tag = `<splat-scene src="floor.splat" crop="${text}"></splat-scene>`;
    assert.ok((await tab.locator('#html').textContent())!.includes(tag), tag);
    // Upside down the same splats are left, and other sliders stand for them.
    await tab.click('#flip');
    await boxIs([-2, -1, 0, 2]);
    assert.equal(await tab.inputValue('#attribute-crop'), text);
    assert.equal(await tab.locator('splat-scene').getAttribute('up'), 'y');
    await tab.fill('#attribute-crop', '1 1 1 0 0 0');
    await tab.locator('#attribute-crop').blur();
    assert.match((await tab.locator('#attribute-crop-fault').textContent())!, /the least first/);
    await tab.fill('#attribute-crop', '');
    await tab.locator('#attribute-crop').blur();
    await boxIs([-2, 2, -2, 2]);
    assert.equal(await tab.locator('splat-scene').count(), 0);

    await tab.click('#reset');
    await tab.fill('#attribute-src', COMPASS);
    await tab.locator('#attribute-src').blur();
    await tab.fill('#attribute-crop', '0 -9 -9 9 9 9');
    await tab.locator('#attribute-crop').blur();
    await tab.waitForFunction(() => document.querySelector('splat-scene'));
    const { pathname, search } = new URL(tab.url());
    const { tab: other, faults: others } = await open.visit(pathname + search, {
      width: 240,
      height: 400,
      prepare: withCompass,
    });
    await loaded(other);
    const min = await other.evaluate(() => document.querySelector('gaussian-splat')!.getBoundingBox()!.min.x);
    assert.ok(Math.abs(min) < 1e-6, `by the link the least x is ${min}`);
    await other.close();
    assert.deepEqual([faults, others], [[], []]);
  });

  it('is a page as every other', () => checkPage(visit));
});
