/** The markup that servers write for the element without any browser API: the documents of React and Vue promise it. */
import assert from 'node:assert/strict';
import { existsSync } from 'node:fs';
import { test } from 'node:test';
import { createElement } from 'react';
import { renderToString as renderReact } from 'react-dom/server';
import { createSSRApp, h } from 'vue';
import { renderToString as renderVue } from 'vue/server-renderer';

const skip = existsSync(new URL('../../packages/react/dist', import.meta.url)) ? false : 'not built: npm run build';

test('React: the component with its children, style and aria-label; the rest is for hydration', { skip }, async () => {
  const { GaussianSplat } = await import('@gaussian-splat/react');
  const poster = createElement('p', { slot: 'poster' }, 'A garden');
  const properties = { src: '/garden.ply', cameraControls: true, pose: [1], onLoad: () => undefined };
  const html = renderReact(
    createElement(GaussianSplat, { ...properties, 'aria-label': 'A garden', style: { width: 3 } }, poster),
  );
  assert.equal(html, '<gaussian-splat aria-label="A garden" style="width:3px"><p slot="poster">A garden</p></gaussian-splat>'); // prettier-ignore
});

test('React: children that are scenes, with what is known on a server', { skip }, async () => {
  const { GaussianSplat, SplatMesh, SplatScene } = await import('@gaussian-splat/react');
  const children = [
    createElement(SplatScene, { key: 0, id: 'plant', src: 'plant.spz', position: [1, 0, 0] }),
    createElement(SplatMesh, { key: 1, src: 'chair.glb', hidden: true }),
  ];
  const html = renderReact(createElement(GaussianSplat, { src: 'room.sog' }, children));
  assert.equal(
    html,
    '<gaussian-splat><splat-scene id="plant"></splat-scene><splat-mesh></splat-mesh></gaussian-splat>',
  );
});

test('Vue: the tag with its attributes', { skip }, async () => {
  await import('@gaussian-splat/element');
  const onLoad = (): void => undefined;
  const app = createSSRApp(() => h('gaussian-splat', { src: '/garden.ply', 'camera-controls': '', pose: [1], onLoad }));
  assert.equal(await renderVue(app), '<gaussian-splat src="/garden.ply" camera-controls></gaussian-splat>');
});
