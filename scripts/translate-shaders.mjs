/** `npm run shaders:webgl`: translates the shaders of the WebGL renderer. Needed after a change of shaders/webgl or its imports. */
import { writeFileSync } from 'node:fs';
import { hasNaga, NAGA, WEBGL_SHADERS, webglShaders } from './lib/webgl-shaders.mjs';

if (!hasNaga()) {
  console.error(`shaders:webgl: expected naga ${NAGA} on the PATH. Install Rust, then: cargo install naga-cli@${NAGA}`);
  process.exit(1);
}
writeFileSync(WEBGL_SHADERS, await webglShaders());
console.log(`written: ${WEBGL_SHADERS}`);
