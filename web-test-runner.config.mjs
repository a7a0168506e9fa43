/**
 * Tests in real Chromium with WebGPU, on SwiftShader where there is no GPU: `npm test`, or after `npm run build`
 * `npx web-test-runner [--files tests/element/browser/idle.test.ts]`. The environment variable CHROMIUM names the browser.
 */
import { playwrightLauncher } from '@web/test-runner-playwright';
import { findChromium } from './scripts/lib/chromium.mjs';
import { pageCommands } from './tests/element/browser/support/commands.mjs';
import { hostileServer, startOtherOrigin } from './tests/element/browser/support/server.mjs';
import { typescript } from './tests/element/browser/support/typescript.mjs';

const otherOrigin = await startOtherOrigin();

const HIGH_DENSITY = 'tests/element/browser/high-density.test.ts';

export default {
  files: ['tests/**/browser/**/*.test.ts', `!${HIGH_DENSITY}`],
  groups: [{ name: 'high-density', files: HIGH_DENSITY, browsers: [chromium(2)] }],
  rootDir: '.',
  // Without this condition Lit is its development build, which warns that it is.
  nodeResolve: { exportConditions: ['production', 'browser'] },
  // SwiftShader draws on the CPU: two pages at once would only slow each other down.
  concurrency: 1,
  concurrentBrowsers: 1,
  browserStartTimeout: 60_000,
  testsFinishTimeout: 240_000,
  testFramework: { config: { ui: 'bdd', timeout: 60_000 } },
  browsers: [chromium(1)],
  middleware: [hostileServer(otherOrigin)],
  plugins: [typescript(), pageCommands()],
};

/** WebGPU on a canvas without a GPU needs all of these switches; where there is one they do no harm. */
function chromium(pixelRatio) {
  return playwrightLauncher({
    product: 'chromium',
    launchOptions: {
      executablePath: findChromium(),
      args: [
        '--no-sandbox',
        '--enable-unsafe-webgpu',
        '--use-angle=swiftshader',
        '--enable-unsafe-swiftshader',
        '--enable-features=Vulkan',
        '--use-vulkan=swiftshader',
        `--force-device-scale-factor=${pixelRatio}`,
      ],
    },
    // The switch changes what canvases see, the context what scripts see: only together are they a dense screen.
    createBrowserContext: ({ browser }) => browser.newContext({ deviceScaleFactor: pixelRatio }),
  });
}
