/** Apps around the element that are no part of the demo: React's in its development build, and one without a framework. */
import { join } from 'node:path';
import { fileURLToPath } from 'node:url';
import { build } from 'esbuild';

const root = fileURLToPath(new URL('../../../../', import.meta.url));
const ELEMENT = '/packages/element/dist/index.js';
const SCENES = '/packages/element/dist/scenes.js';

export const DEVELOPMENT_APP = `<!doctype html><html lang="en"><title>React, development build</title>
  <div id="app"></div>
  <script type="module" src="/net/react-development/app.js"></script>`;

let script;

/**
 * demo/react with React's development build, whose StrictMode mounts everything twice; the demo uses the production
 * build, whose StrictMode does nothing. The element comes from its modules, because the app imports two of them.
 */
export function developmentScript() {
  script ??= build({
    entryPoints: [join(root, 'demo/react/main.tsx')],
    bundle: true,
    write: false,
    format: 'esm',
    target: 'es2022',
    jsx: 'automatic',
    jsxDev: true,
    define: { 'process.env.NODE_ENV': '"development"' },
    conditions: ['development'],
    alias: { '@gaussian-splat/element': ELEMENT, '@gaussian-splat/element/scenes.js': SCENES },
    external: [ELEMENT, SCENES],
  }).then(({ outputFiles }) => outputFiles[0].text);
  return script;
}

const bundles = new Map();

/** A module of tests/frameworks/browser/support with all that it imports: browsers cannot read React's own modules. */
export function frameworkScript(name) {
  if (!bundles.has(name)) {
    const options = {
      entryPoints: [join(root, 'tests/frameworks/browser/support', name)],
      bundle: true,
      write: false,
      splitting: false,
      format: 'esm',
      target: 'es2022',
      jsx: 'automatic',
      define: {
        'process.env.NODE_ENV': '"production"',
        __VUE_OPTIONS_API__: 'true',
        __VUE_PROD_DEVTOOLS__: 'false',
        __VUE_PROD_HYDRATION_MISMATCH_DETAILS__: 'false',
      },
      conditions: ['production', 'browser'],
    };
    bundles.set(
      name,
      build(options).then(({ outputFiles }) => outputFiles[0].text),
    );
  }
  return bundles.get(name);
}

/** The app of the React and Vue tests in plain HTML around the CDN build at an address. */
export function plainApp(address) {
  return `<!doctype html><html lang="en"><title>Plain</title>
    <script type="module" src="${address}"></script>
    <h1>Plain HTML</h1>
    <button id="toggle">Take it away</button> <button id="swap">Another scene</button> <button id="view">Where?</button>
    <div id="place"></div>
    <output id="status">waiting</output> <output id="loads">0</output> <output id="moves">0</output>
    <output id="times">0</output> <output id="where"></output>
    <script type="module">
      const query = new URLSearchParams(location.search);
      const scenes = [query.get('first'), query.get('second')];
      const controls = { smile: 0.4 };
      const [place, toggle, status, where] = ['place', 'toggle', 'status', 'where'].map((id) => document.getElementById(id));
      const count = (id) => void document.getElementById(id).textContent++;
      let scene = 0;

      function mount() {
        place.innerHTML = '<gaussian-splat alt="A scene" loading="eager" camera-controls style="width: 320px; height: 240px">' +
          '<button slot="hotspot-forehead" data-position="0m 0.33m 0.25m">The forehead</button></gaussian-splat>';
        const splat = place.firstElementChild;
        splat.src = scenes[scene];
        splat.inputValues = controls;
        splat.addEventListener('load', ({ detail }) => (count('loads'), (status.textContent = 'loaded ' + detail.url)));
        splat.addEventListener('error', ({ detail }) => (status.textContent = detail.code + ': ' + detail.message));
        splat.addEventListener('camera-change', () => count('moves'));
        splat.addEventListener('timeupdate', () => count('times'));
      }

      toggle.addEventListener('click', () => {
        if (place.firstElementChild) place.replaceChildren();
        else mount();
        toggle.textContent = place.firstElementChild ? 'Take it away' : 'Bring it back';
      });
      document.getElementById('swap').addEventListener('click', () => {
        scene = 1 - scene;
        place.firstElementChild.src = scenes[scene];
      });
      document.getElementById('view').addEventListener('click', () => {
        const splat = place.firstElementChild;
        where.textContent = splat.getCameraOrbit() + ', controls by reference: ' + (splat.inputValues === controls);
      });
      mount();
    </script>`;
}
