/** Loads the element under the policy of the page, and leaves in `window.report` what came of it. */
const violations = [];
const warnings = [];
addEventListener('securitypolicyviolation', ({ effectiveDirective }) => violations.push(effectiveDirective));
console.warn = (...words) => warnings.push(words.join(' '));
const delay = (ms) => new Promise((resolve) => setTimeout(resolve, ms));

async function observe() {
  await import('/cdn/gaussian-splat.min.js');
  const element = document.querySelector('gaussian-splat');
  await element.ready;
  await delay(1_000);
  const { width, display } = getComputedStyle(element.shadowRoot.querySelector('canvas'));
  const workers = performance.getEntriesByType('resource').filter(({ name }) => /scene-worker\.js$/.test(name)).length;
  const { loaded, error } = element;
  return JSON.stringify({
    loaded,
    error: error?.message,
    violations,
    warnings,
    workers,
    canvas: `${display} ${width}`,
  });
}

window.report = observe();
