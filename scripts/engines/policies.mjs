/** Pages under strict policies, in any engine: the policy of docs/guide/hosting.md with Trusted Types, no workers, the build on another server, and `embed.html` in frames as hosts make them. */
import { readFileSync } from 'node:fs';
import { join } from 'node:path';
import { serve } from '../../packages/cli/src/lib/server.mjs';
import { root } from '../lib/run.mjs';
import { assert, check, paintedShare } from './checks.mjs';

const MOUNTS = {
  '/policies': join(root, 'scripts/engines/policies'),
  '/cdn': join(root, 'packages/element/cdn'),
  '/fixtures': join(root, 'tests/element/browser/fixtures'),
};
const CORS = { 'access-control-allow-origin': '*' };
const NO_WORKERS = "default-src 'none'; script-src 'self'; connect-src 'self'; style-src 'self'; worker-src 'none'";
/** Attributes of frames, as hosts write them; the last ones as WordPress does with embeds of other sites. */
const FRAMES = [
  {},
  { sandbox: 'allow-scripts allow-same-origin' },
  { sandbox: 'allow-scripts' },
  { referrerpolicy: 'no-referrer' },
  { allow: "fullscreen 'none'; xr-spatial-tracking 'none'; gamepad 'none'" },
  { sandbox: 'allow-scripts', security: 'restricted', referrerpolicy: 'no-referrer', loading: 'lazy' },
];

/** The policy that the guide recommends. */
function recommended() {
  const guide = readFileSync(join(root, 'docs/guide/hosting.md'), 'utf8');
  return /Content-Security-Policy: ([^`]+)/.exec(guide)[1].replace(/\s+/g, ' ').trim();
}

export async function checkPolicies(tab) {
  await withServer({ 'content-security-policy': recommended() }, (origin) =>
    check('the policy of the guide, Trusted Types included', async () => {
      const { violations, warnings, workers, ...rest } = await reportOf(tab, `${origin}/policies/secure.html`);
      assert(rest.loaded, rest.error);
      assert(violations.length + warnings.length === 0, [...violations, ...warnings].join('; '));
      assert(workers > 0, 'no worker');
      // Its style sheet is applied, without a violation.
      assert(rest.canvas.startsWith('block'), `canvas: ${rest.canvas}`);
      return 'no violation, with a worker';
    }),
  );
  await withServer({ 'content-security-policy': NO_WORKERS }, (origin) =>
    check('a policy without workers: read on the main thread, with one warning', async () => {
      const { loaded, error, violations, warnings } = await reportOf(tab, `${origin}/policies/secure.html`);
      assert(loaded, error);
      assert(warnings.length === 1 && /worker-src/.test(warnings[0]), warnings.join('; '));
      return `violations: ${[...new Set(violations)].join(', ') || 'none reported'}`;
    }),
  );
  await withServer(CORS, (cdn) =>
    withServer({}, async (origin) => {
      await check('the build from another server, with integrity', async () => {
        const { loaded, error, own } = await reportOf(tab, `${origin}/policies/cdn.html?cdn=${cdn}`);
        assert(loaded, error);
        assert(own === 0, `${own} scripts of its own server`);
      });
      // Policies are meant to be violated here; other errors count.
      await check('strict pages throw nothing', async () => {
        const thrown = (await tab.takeExceptions()).filter((text) => !/Content-Security-Policy/.test(text));
        assert(thrown.length === 0, thrown.join('; '));
      });
      await check(`embed.html in ${FRAMES.length} kinds of frames`, () => checkFrames(tab, origin, cdn));
    }),
  );
}

/** Meshes under the guide's policy, which need WebGPU: a texture within a GLB, a buffer in the JSON, and meshopt with the directive that the guide names. */
export async function checkMeshPolicies(tab) {
  const policy = recommended();
  const withWasm = policy.replace("script-src 'self'", "script-src 'self' 'wasm-unsafe-eval'");
  const cases = {
    '/fixtures/textured.glb': policy,
    '/policies/triangle.gltf': policy,
    '/fixtures/meshopt.glb': withWasm,
  };
  for (const [file, header] of Object.entries(cases))
    await withServer({ 'content-security-policy': header }, (origin) =>
      check(`the policy of the guide with the mesh ${file}`, async () => {
        const { mesh, violations, warnings } = await reportOf(tab, `${origin}/policies/secure.html?mesh=${file}`);
        assert(mesh === 'shown', mesh);
        assert(violations.length + warnings.length === 0, [...violations, ...warnings].join('; '));
        return 'no violation';
      }),
    );
}

/** Scripts cannot read frames without an origin, so the test reads the screen. */
async function checkFrames(tab, origin, host) {
  const blank = [];
  for (const attributes of FRAMES) {
    await tab.open(`${origin}/policies/frames.html`);
    await tab.evaluate(`(() => {
      const frame = document.createElement('iframe');
      for (const [name, value] of Object.entries(${JSON.stringify(attributes)})) frame.setAttribute(name, value);
      frame.src = '${host}/cdn/embed.html?src=/fixtures/compass.ply&interaction-prompt=none';
      document.body.append(frame);
    })()`);
    const isShown = await until(async () => paintedShare(await tab.screenshot(FRAME), FRAME) > 0.002);
    if (!isShown) blank.push(JSON.stringify(attributes));
  }
  assert(blank.length === 0, `blank: ${blank.join(', ')}`);
}

const FRAME = { width: 200, height: 150 };

async function until(condition) {
  for (const end = Date.now() + 60_000; Date.now() < end;) {
    if (await condition()) return true;
    await new Promise((resolve) => setTimeout(resolve, 500));
  }
  return false;
}

async function reportOf(tab, address) {
  await tab.open(address);
  return JSON.parse(await tab.evaluate('window.report'));
}

async function withServer(headers, body) {
  const server = await serve(MOUNTS, { headers });
  try {
    return await body(`http://localhost:${server.address().port}`);
  } finally {
    server.closeAllConnections();
    server.close();
  }
}
