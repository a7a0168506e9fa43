/** The widget in JupyterLab, with a real kernel and a real browser, which may reach nothing but JupyterLab. */
import assert from 'node:assert/strict';
import { spawn } from 'node:child_process';
import { cpSync, writeFileSync } from 'node:fs';
import { createServer } from 'node:net';
import { join } from 'node:path';
import { chromium } from 'playwright';
import { findChromium, gpuFlags } from '../../../scripts/lib/chromium.mjs';

/** Limit of each wait, ms, on a busy machine without a GPU. */
const LIMIT = Number(process.env.LIMIT ?? 240_000);

const CELLS = [
  `import json, time
import numpy as np
from gaussian_notebook import Splats
from training import arrays, ring, start, train
scene = start(200)
widget = Splats(*arrays(scene).values(), camera_orbit="30deg 70deg 3m", interaction_prompt="none", height="300px")
widget`,
  `psnr = train(scene, lambda state: (widget.update(**state), time.sleep(0.05)), 19)
print("trained", widget._step)`,
  `print("shown", widget.shown, widget.state, widget.error)`,
  `disc = 41
x, z = [a.ravel() for a in np.meshgrid(np.linspace(-1, 1, disc), np.linspace(-1, 1, disc))]
means = np.stack([x, np.full_like(x, 0.25), z], axis=1)
flat = len(means)
step = widget.update(means, np.tile([1, 0, 0, 0], (flat, 1)), np.tile([0.05, 0.005, 0.05], (flat, 1)), np.full(flat, 0.99), np.tile([1, 0.5, 0], (flat, 1)))
widget.camera_orbit, widget.camera_target = "0deg 0deg 4m", "0m 0m 0m"
widget.markers = [[0, 0, 1]]
print("floor", step)`,
  `print("pick", json.dumps(widget.pick), "orbit", widget.camera_orbit, "shown", widget.shown)`,
];

/** @param python Python of the environment with the installed wheel. @param home Folder for the notebook. */
export async function testInJupyterLab({ python, home, examples }) {
  const port = await freePort();
  const source = (text) => text.split('\n').map((line, k, all) => (k < all.length - 1 ? `${line}\n` : line));
  const cells = CELLS.map((text, k) => ({
    ...{ cell_type: 'code', id: `cell-${k}`, metadata: {}, execution_count: null, outputs: [], source: source(text) },
  }));
  const kernelspec = { name: 'python3', display_name: 'Python 3', language: 'python' };
  writeFileSync(
    join(home, 'test.ipynb'),
    JSON.stringify({ cells, metadata: { kernelspec }, nbformat: 4, nbformat_minor: 5 }),
  );
  cpSync(join(examples, 'training.py'), join(home, 'training.py'));
  const options = ['--no-browser', '--allow-root', `--port=${port}`, '--ServerApp.token=', '--ServerApp.password='];
  const own = { JUPYTER_CONFIG_DIR: join(home, 'config'), JUPYTER_DATA_DIR: join(home, 'data') };
  const server = spawn(
    python,
    ['-m', 'jupyterlab', ...options, '--LabApp.expose_app_in_browser=True', '--LabApp.news_url=None'],
    {
      cwd: home,
      env: { ...process.env, ...own, JUPYTER_RUNTIME_DIR: join(home, 'run') },
      stdio: ['ignore', 'pipe', 'pipe'],
    },
  );
  let log = '';
  for (const stream of [server.stdout, server.stderr]) stream.on('data', (text) => (log += text));
  const ended = new Promise((resolve) => server.once('exit', resolve));
  const address = `http://localhost:${port}`;
  const browser = await chromium.launch({ executablePath: findChromium(), args: gpuFlags() });
  try {
    await until(
      () =>
        fetch(`${address}/api`).then(
          ({ ok }) => ok,
          () => false,
        ),
      'the server',
    );
    const page = await browser.newPage({ viewport: { width: 1200, height: 900 } });
    page.on('console', (message) => (log += `page: ${message.text()}\n`));
    page.on('pageerror', (error) => (log += `page: ${error.stack}\n`));
    const outside = [];
    await page.route(
      (url) => url.host !== `localhost:${port}` && /^(https?|wss?):$/.test(url.protocol),
      (route) => (outside.push(route.request().url()), route.abort()),
    );
    await page.goto(`${address}/lab/tree/test.ipynb?reset`);
    await run(page).catch(async (error) => {
      if (process.env.SCREENSHOT) await page.screenshot({ path: process.env.SCREENSHOT });
      throw error;
    });
    assert.deepEqual(outside, [], 'requests to other hosts');
  } catch (error) {
    console.error(log.slice(-3000));
    throw error;
  } finally {
    await browser.close();
    server.kill();
    await ended;
  }
}

async function run(page) {
  await page.waitForFunction(() => globalThis.jupyterapp?.shell.currentWidget?.context?.isReady, null, {
    timeout: LIMIT,
  });
  await page.waitForFunction(
    () => globalThis.jupyterapp.shell.currentWidget.sessionContext.session?.kernel?.status === 'idle',
    null,
    { timeout: LIMIT },
  );
  // The first cell is active, and each run selects the next one.
  const runCell = () =>
    page.evaluate(() => globalThis.jupyterapp.commands.execute('notebook:run-cell-and-select-next'));
  const text = (k) =>
    page.evaluate((index) => {
      const { content } = globalThis.jupyterapp.shell.currentWidget;
      return content.widgets[index].model.outputs
        .toJSON()
        .map(({ text = '', traceback = [] }) => [text, ...traceback].flat().join(''))
        .join('');
    }, k);
  const printed = (k, pattern) => until(async () => pattern.exec(failed(await text(k))), `the output ${pattern}`);
  const view = page.locator('gaussian-splat');

  await runCell();
  await until(
    async () => (failed(await text(0)), view.evaluate((element) => element.loaded === true).catch(() => false)),
    'the widget',
  );
  await runCell();
  await printed(1, /trained 20/);
  await page.waitForTimeout(1000);
  await until(async () => {
    await page.evaluate(() => {
      globalThis.jupyterapp.shell.currentWidget.content.activeCellIndex = 2;
    });
    await runCell();
    return /shown 20 ready\s*$/.test(failed(await text(2)));
  }, '20 shown updates');

  await runCell();
  const [, step] = await printed(3, /floor (\d+)/);
  await until(
    () => view.evaluate((element) => element.getAttribute('camera-orbit') === '0deg 0deg 4m'),
    'the camera of the kernel',
  );
  await page.waitForTimeout(2000);
  await view.scrollIntoViewIfNeeded();
  assert.equal(await page.locator('gaussian-splat > [slot=hotspot-marker-0]').count(), 1, 'the marker');
  const box = await view.boundingBox();
  await page.mouse.click(box.x + box.width / 2 + 30, box.y + box.height / 2);
  await page.waitForTimeout(1000);
  const pick = await until(async () => {
    await page.evaluate(() => {
      globalThis.jupyterapp.shell.currentWidget.content.activeCellIndex = 4;
    });
    await runCell();
    const found = /pick (.*) orbit (.*) shown (\d+)/.exec(failed(await text(4)));
    return found && found[1] !== 'null' && found[3] === step && JSON.parse(found[1]);
  }, 'the pick in the kernel');
  // From 4 m above the floor at y = -0.25 in viewer space, 30 of 300 pixels aside.
  const aside = (30 / 300) * 4.25 * 2 * Math.tan(Math.PI / 8);
  const [x, y, z] = pick.position;
  assert.ok(Math.abs(x - aside) < 0.02 && Math.abs(y + 0.25) < 0.03 && Math.abs(z) < 0.02, JSON.stringify(pick));
  assert.ok(Number.isInteger(pick.splat), JSON.stringify(pick));

  await page.mouse.move(box.x + 100, box.y + 150);
  await page.mouse.down();
  await page.mouse.move(box.x + 160, box.y + 120, { steps: 5 });
  await page.mouse.up();
  await page.waitForTimeout(1500);
  await until(async () => {
    await page.evaluate(() => {
      globalThis.jupyterapp.shell.currentWidget.content.activeCellIndex = 4;
    });
    await runCell();
    return /orbit -?[\d.]+rad [\d.]+rad 4m/.test(failed(await text(4)));
  }, 'the moved camera in the kernel');
  console.log(
    `JupyterLab: 20 updates, a pick at ${pick.position.map((value) => value.toFixed(3))}, and both directions of the camera`,
  );
}

/** Returns the output of a cell; throws if the cell has failed. */
function failed(output) {
  assert.doesNotMatch(output, /Traceback|Error/, output);
  return output;
}

async function until(condition, what) {
  const end = Date.now() + LIMIT;
  for (;;) {
    const found = await condition();
    if (found) return found;
    assert.ok(Date.now() < end, `waited ${LIMIT / 1000} s for ${what}`);
    await new Promise((resolve) => setTimeout(resolve, 500));
  }
}

const freePort = () =>
  new Promise((resolve) => {
    const server = createServer().listen(Number(process.env.TEST_PORT ?? 0), () => {
      const { port } = server.address();
      server.close(() => resolve(port));
    });
  });
