/**
 * `npm run lab -- webkit`: the built element and site in WebKitGTK, in a window of Xvfb (Debian: webkit2gtk-driver, xvfb). It has no WebGPU, so WebGL 2 draws. Screenshots are compared
 * with those of Chromium; those of whole pages are left in `.cache/engines/webkit`. After `npm run build`. Not part of `npm test`.
 */
import {
  checkHands,
  checkLostContext,
  checkPages,
  checkParts,
  checkScenes,
  checkThrown,
  withSite,
} from './engines/checks.mjs';
import { checkPolicies } from './engines/policies.mjs';
import { withDisplay } from './lib/firefox.mjs';
import { launchWebKit, WebKitTab } from './lib/webkit.mjs';

const SCENES = {
  'a PLY': { src: '/fixtures/compass.ply', renderer: 'webgl' },
  'the skull that ships': { src: '/scenes/skull.spz', renderer: 'webgl' },
  'a PLY from the side': { src: '/fixtures/compass.ply', renderer: 'webgl', 'camera-orbit': '130deg 60deg 5m' },
};

const UNCOVERED = [
  'Safari, and any device of Apple',
  'WebGPU, which WebKitGTK lacks, and so generators, children and meshes',
  'touch, which its driver lacks',
  'a GPU: llvmpipe draws',
  'VR and AR, sound, recording',
];

const status = await withSite(UNCOVERED, (origin) =>
  withDisplay(async (env) => {
    const webkit = await launchWebKit({ env });
    try {
      const tab = new WebKitTab(webkit, origin);
      await tab.open('/engines/page.html');
      const facts = await tab.evaluate(`[navigator.gpu ? 'WebGPU' : 'no WebGPU',
        document.createElement('canvas').getContext('webgl2')?.getExtension('EXT_float_blend') ? 'blends float32' : 'blends no float32'].join(', ')`);
      console.log(`WebKitGTK ${webkit.version}: ${facts}`);
      await checkScenes(tab, origin, SCENES);
      await checkParts(tab, 'webgl');
      await checkHands(tab, { renderer: 'webgl', hasTouch: false });
      await checkLostContext(tab);
      await checkThrown(tab);
      await checkPolicies(tab);
      await checkPages(tab, 'webkit');
    } finally {
      await webkit.close();
    }
  }),
);
process.exit(status);
