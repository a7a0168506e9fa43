/** The page of embed.html: its address says what is shown. */
import { GaussianSplatElement } from './gaussian-splat.min.js';

/** Attributes that are addresses. */
const ADDRESSES = ['src', 'poster'];
/** Attributes that name further models, or send cookies to other servers: a link that somebody else has written sets none of these. */
const REFUSED = ['contract', 'chain', 'postprocess', 'crossorigin'];

/** What a `<splat-scene>` has in the element's place. */
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
    `${name}: expected a file of ${[location.origin, ...origins].join(' or ')}, found "${found}". Whoever runs this page lists other origins in embed.html.`,
  );
}

function show() {
  if (!query.has('src')) throw new Error('src: expected the address of a scene, as in embed.html?src=garden.spz');
  const scene = document.createElement('gaussian-splat');
  scene.setAttribute('camera-controls', '');
  // A box belongs to a scene, which then has a tag of its own.
  const holder = query.has('crop') ? scene.appendChild(document.createElement('splat-scene')) : scene;
  for (const [name, value] of query) {
    const isOfScene = OF_SCENE.includes(name);
    const isKnown = isOfScene || GaussianSplatElement.observedAttributes.includes(name);
    if (!isKnown || REFUSED.includes(name)) continue;
    if (name === 'camera-controls' && value === 'false') scene.removeAttribute(name);
    else (isOfScene ? holder : scene).setAttribute(name, ADDRESSES.includes(name) ? allowed(name) : value);
  }
  document.title = query.get('alt') || document.title;
  document.querySelector('main').append(scene);
  offerFullScreen(document.querySelector('button'));
}

/** A frame shows no button of the page around it. The whole page gets large, so that its button, which also ends it, stays in sight. */
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
