/** The page of embed.html: its address says what is shown. */
import { GaussianSplatElement } from './gaussian-splat.min.js';

/** Attributes that are addresses. */
const ADDRESSES = ['src', 'poster'];
/** Attributes that name further models, or send cookies to other servers: a link that somebody else has written sets none of these. */
const REFUSED = ['contract', 'chain', 'postprocess', 'crossorigin'];

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
  for (const [name, value] of query) {
    if (!GaussianSplatElement.observedAttributes.includes(name) || REFUSED.includes(name)) continue;
    if (name === 'camera-controls' && value === 'false') scene.removeAttribute(name);
    else scene.setAttribute(name, ADDRESSES.includes(name) ? allowed(name) : value);
  }
  document.body.append(scene);
}

try {
  show();
} catch (error) {
  const sentence = document.createElement('p');
  sentence.textContent = error.message;
  document.body.append(sentence);
}
