/** The page of embed.html: its address says what is shown. */
import './gaussian-splat.min.js';

/** Attributes that are addresses. */
const ADDRESSES = ['src', 'poster', 'views', 'skybox-image', 'walk-map', 'ios-src', 'ios-splats'];
/**
 * Attributes that a link may set. Attributes that name further models, send cookies to other servers, or set texts are
 * excluded, because the author of the link is
 * untrusted.
 */
const ALLOWED = [
  ...ADDRESSES,
  ...['alt', 'loading', 'reveal', 'camera-controls', 'camera-orbit', 'camera-target', 'field-of-view'],
  ...['min-camera-orbit', 'max-camera-orbit', 'min-camera-target', 'max-camera-target'],
  ...['min-field-of-view', 'max-field-of-view', 'interpolation-decay', 'touch-action', 'zoom'],
  ...['disable-zoom', 'disable-pan', 'disable-tap', 'navigation', 'auto-rotate', 'auto-rotate-delay'],
  ...['rotation-per-second', 'interaction-prompt', 'interaction-prompt-style', 'interaction-prompt-threshold'],
  ...['up', 'max-pixel-ratio', 'frame-budget', 'quality', 'renderer', 'max-sh-degree', 'filter', 'order', 'detail'],
  ...['controls-panel', 'time', 'pose', 'crop', 'autoplay', 'loop', 'orthographic', 'reveal-effect'],
  ...['unit', 'eye-height', 'measure', 'shadow-intensity', 'shadow-softness'],
  ...['vr', 'ar', 'ar-modes', 'ar-placement', 'ar-scale'],
];

/** Attributes of a `<splat-scene>` in place of those of the element. */
const OF_SCENE = ['src', 'up', 'crop', 'pose'];

const query = new URLSearchParams(location.search);
const origins = document.querySelector('meta[name=allowed-origins]').content.split(/\s+/).filter(Boolean);

/**
 * The address of a file that this page may show: of this server, or of an origin that the page lists. Schemes such as `javascript:`, `data:` and `blob:` are
 * of no such origin.
 */
function allowed(name) {
  const url = URL.canParse(query.get(name), location.href) ? new URL(query.get(name), location.href) : undefined;
  const isWeb = url && /^https?:$/.test(url.protocol) && url.username === '' && url.password === '';
  if (isWeb && [location.origin, ...origins].includes(url.origin)) return url.href;
  const found = query.get(name).slice(0, 200);
  throw new Error(
    `${name}: expected a file of ${[location.origin, ...origins].join(' or ')}, found "${found}". The owner of this page lists other origins in embed.html.`,
  );
}

/**
 * Redirects lead to other servers, too: the policy of the page lets none of them be asked. A worker has the policy of its own script, or that of the page if the
 * page made its script as text. In a sandboxed frame the element makes that text itself.
 */
function restrict() {
  const policy = document.createElement('meta');
  policy.httpEquiv = 'Content-Security-Policy';
  const sources = [location.origin, ...origins].join(' ');
  policy.content = `connect-src ${sources}; img-src ${sources} blob: data:`;
  document.head.append(policy);
  if (globalThis.origin === 'null') return;
  const text = `import ${JSON.stringify(new URL('scene-worker.js', import.meta.url))}`;
  customElements.get('gaussian-splat').workerLocation = `data:text/javascript,${encodeURIComponent(text)}`;
}

function show() {
  restrict();
  if (!query.has('src')) throw new Error('src: expected the address of a scene, as in embed.html?src=garden.spz');
  const scene = document.createElement('gaussian-splat');
  scene.setAttribute('camera-controls', '');
  // A box belongs to a scene, which then has a tag of its own.
  const holder = query.has('crop') ? scene.appendChild(document.createElement('splat-scene')) : scene;
  for (const [name, value] of query) {
    if (!ALLOWED.includes(name)) continue;
    if (name === 'camera-controls' && value === 'false') scene.removeAttribute(name);
    else
      (OF_SCENE.includes(name) ? holder : scene).setAttribute(name, ADDRESSES.includes(name) ? allowed(name) : value);
  }
  document.title = query.get('alt') || document.title;
  document.querySelector('main').append(scene);
  offerFullScreen(document.querySelector('button'));
}

/**
 * An iframe covers the page's own buttons. The whole page goes full screen, so that its button, which also ends full
 * screen, stays visible.
 */
function offerFullScreen(button) {
  button.hidden = !document.fullscreenEnabled;
  button.addEventListener('click', () =>
    document.fullscreenElement ? document.exitFullscreen() : document.documentElement.requestFullscreen(),
  );
  document.addEventListener('fullscreenchange', () => {
    button.ariaLabel = document.fullscreenElement ? 'Leave full screen' : 'Full screen';
  });
}

try {
  show();
} catch (error) {
  const sentence = document.createElement('p');
  sentence.textContent = error.message;
  document.querySelector('main').append(sentence);
}
