/** The committed shaders of the WebGL renderer match the current WGSL: they are generated, and not edited by hand. */
import assert from 'node:assert/strict';
import { readFileSync } from 'node:fs';
import { test } from 'node:test';
import { SOURCE_DIGEST } from '@gaussian-splat/renderer/webgl';
import { digestOfSource, hasNaga, NAGA, WEBGL_SHADERS, webglShaders } from '../../scripts/lib/webgl-shaders.mjs';

test('they were translated from this WGSL', () => {
  assert.equal(
    SOURCE_DIGEST,
    digestOfSource(),
    `shaders/ has changed since packages/renderer/src/webgl/shaders.ts was written: npm run shaders:webgl (cargo install naga-cli@${NAGA})`,
  );
});

test('translated again they are the same', { skip: hasNaga() ? false : `naga ${NAGA} is not here` }, async () => {
  assert.equal(readFileSync(WEBGL_SHADERS, 'utf8'), await webglShaders());
});
