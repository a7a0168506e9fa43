/** Loads the element under the policy of the page, and leaves in `window.report` the result. */
const violations = [];
const warnings = [];
addEventListener('securitypolicyviolation', ({ effectiveDirective }) => violations.push(effectiveDirective));
console.warn = (...words) => warnings.push(words.join(' '));
const delay = (ms) => new Promise((resolve) => setTimeout(resolve, ms));

/** A mesh beside the splats, loaded or refused. */
async function meshIn(element, src) {
  const mesh = Object.assign(document.createElement('splat-mesh'), { src });
  element.append(mesh);
  for (const end = performance.now() + 60_000; performance.now() < end && !mesh.loaded && !mesh.error;) await delay(50);
  return mesh;
}

async function observe() {
  await import('/cdn/gaussian-splat.min.js');
  const element = document.querySelector('gaussian-splat');
  await element.ready;
  const src = new URLSearchParams(location.search).get('mesh');
  const mesh = src && (await meshIn(element, src));
  await delay(1_000);
  const { width, display } = getComputedStyle(element.shadowRoot.querySelector('canvas'));
  const workers = performance.getEntriesByType('resource').filter(({ name }) => /scene-worker\.js$/.test(name)).length;
  const { loaded, error } = element;
  return JSON.stringify({
    loaded,
    error: error?.message,
    mesh: mesh && (mesh.error?.message ?? 'shown'),
    violations,
    warnings,
    workers,
    canvas: `${display} ${width}`,
  });
}

window.report = observe();
