/** The apps of React and Vue, and what their types take and refuse, checked by their frameworks' own checkers; their wrappers know every event. */
import assert from 'node:assert/strict';
import { spawnSync } from 'node:child_process';
import { existsSync } from 'node:fs';
import { test } from 'node:test';
import { fileURLToPath } from 'node:url';

const root = fileURLToPath(new URL('../../', import.meta.url));
const skip = existsSync(`${root}packages/react/dist`) ? false : 'not built: npm run build';

const CHECKERS = { react: 'typescript-7/bin/tsc', vue: 'vue-tsc/bin/vue-tsc.js' };

for (const [name, checker] of Object.entries(CHECKERS)) {
  test(`the app of ${name} is well typed, and its types refuse what would not work`, { skip }, () => {
    const args = [`node_modules/${checker}`, '--project', `tests/frameworks/${name}`];
    const { status, stdout, stderr } = spawnSync(process.execPath, args, { cwd: root, encoding: 'utf8' });
    assert.equal(status, 0, stdout + stderr);
  });
}

test('React has a handler for every event in the manifest', { skip }, async () => {
  const { default: manifest } = (await import(`${root}packages/element/custom-elements.json`, {
    with: { type: 'json' },
  })) as { default: { modules: { declarations: { tagName?: string; events?: { name: string }[] }[] }[] } };
  const { HANDLERS } = (await import(`${root}packages/react/dist/events.js`)) as { HANDLERS: Record<string, string> };
  const element = manifest.modules.flatMap(({ declarations }) => declarations).find((d) => d.tagName);
  assert.deepEqual(Object.values(HANDLERS).sort(), element?.events?.map(({ name }) => name).sort());
  for (const [handler, event] of Object.entries(HANDLERS)) {
    assert.equal(handler.toLowerCase(), `on${event.replaceAll('-', '')}`);
  }
});
