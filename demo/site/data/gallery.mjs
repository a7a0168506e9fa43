/** The scenes of the gallery, in its order. Sizes come from the files, counts from `npm run lab -- posters`. */
import { existsSync, readdirSync, readFileSync, statSync } from 'node:fs';
import { basename, join } from 'node:path';
import { root } from '../../../scripts/lib/run.mjs';

/** A visitor who walks starts where the poster was taken: level, with the eyes 1.6 m above the floor. */
const walked = (name) => ({
  navigation: 'walk',
  'walk-map': `scenes/studio/${name}.floor`,
  unit: '1m',
  measure: '',
  vr: '',
});
const model = (name) => `generators/${name}/model.onnx`;
/** Generators fetch ONNX Runtime, so that a click starts them. */
const clicked = { reveal: 'manual' };
const STUDIO = 'Trained for this project from images that it traced, CC0.';
const TRAINED = 'Trained for this project.';

const SCENES = [
  {
    ...{ id: 'apartment', kind: 'room', title: 'Walk through an apartment', src: 'scenes/studio/apartment.spz' },
    alt: 'A living room with a kitchen; an open door leads to a bedroom',
    view: ['-117.3deg 90deg 3.26m', '3.6m 1.6m 2.4m', '60deg'],
    attributes: walked('apartment'),
    words:
      'Click or tap on the floor to go there, or use the arrow keys. Doors lead to a bedroom and a study. The ruler measures between two points; the large window is 2.38 m wide. With a headset you can walk in VR.',
    credit: STUDIO,
  },
  {
    ...{ id: 'robot', kind: 'object', title: 'A robot arm on a desk', src: 'scenes/studio/product.spz' },
    alt: 'A desk with an orange robot arm, sunglasses, glasses and a lamp',
    view: ['0.9deg 69deg 1m', '0.02m 0.99m 0.22m', '47deg'],
    words: 'Glass, gloss and thin parts, from 140 images of a moving phone.',
    credit: `${STUDIO} Robot arm: “Black Honey”, sunglasses: Eric Chadwick, both CC BY 4.0.`,
  },
  {
    ...{ id: 'house', kind: 'room', title: 'A tour of a house', src: 'scenes/studio/garden.spz' },
    alt: 'A brick house with a green door behind a lawn',
    view: ['-23.9deg 90deg 6m', '-2.74m 1.6m 2.52m', '52deg'],
    attributes: { ...walked('garden'), 'floor-plan': '' },
    doors: [
      ['garden', 'apartment', '0m 1.6m 0.3m', '0deg', 'Into the house'],
      ['apartment', 'garden', '0.3m 1.6m 1.2m', '90deg', 'To the garden'],
      ['apartment', 'hall', '7.2m 1.6m -2.4m', '0deg', 'To the hall', '112deg'],
      ['hall', 'apartment', '-8.7m 1.6m 0m', '90deg', 'To the study'],
    ],
    words:
      'Three captures with doors between them. Walk to a door or choose its label; the plan comes from the maps of the floors. In VR the doors work, too.',
    credit: STUDIO,
  },
  {
    ...{ id: 'hall', kind: 'room', title: 'A hall with a statue', src: 'scenes/studio/hall.spz' },
    alt: 'A statue on a plinth between columns',
    view: ['-179.6deg 90deg 5m', '1.02m 1.6m 2.59m', '59deg'],
    attributes: walked('hall'),
    words: 'Walk among columns and statues. Trained from 150 images of a moving phone; nothing is cleaned.',
    credit: `${STUDIO} The cat is by Ankledot, CC BY 4.0.`,
  },
  {
    ...{ id: 'statue', kind: 'object', title: 'A captured statue', src: 'scenes/st-peter.sog' },
    alt: 'A statue of Saint Peter',
    view: ['200deg 80deg 100%'],
    attributes: { 'reveal-effect': 'sweep y 2s' },
    words: 'Captured outdoors, saved as SOG. It appears from below.',
    credit: 'From playcanvas/web-components, MIT.',
  },
  {
    ...{ id: 'toy', kind: 'streamed', title: 'A toy, streamed', src: 'scenes/playbot/lod-meta.json' },
    alt: 'A toy robot',
    view: ['-30deg 75deg 75%'],
    words: 'The first frame comes from the coarsest of five levels, 70 kB. Finer ones follow where you look.',
    credit: '“PLAYBOT” by Stephane Agullo, CC BY 4.0.',
  },
  {
    ...{ id: 'vase', kind: 'clip', title: 'Dust becomes a vase', src: 'scenes/vase.gsv' },
    alt: 'Dust becomes a vase and blows away',
    view: ['30deg 72deg 5.5m', '0m 0.9m 0m', '30deg'],
    attributes: { time: '5', loop: '', autoplay: '' },
    words: 'One file that plays while it loads: 10 seconds, 5,700 splats that come and go.',
    credit: 'Computed when this site is built.',
  },
  {
    ...{ id: 'skull', kind: 'object', title: 'A skull from photographs', src: 'scenes/skull.spz' },
    alt: 'A skull',
    view: ['-35deg 80deg 97.5%', '0m 0m 0m', '30deg'],
    words: 'Trained from 65 photographs. The gloss follows the view.',
    credit: 'Trained from photographs of alansartlog, CC BY 4.0.',
  },
  {
    ...{ id: 'plant', kind: 'generator', title: 'A plant in the wind', src: model('plant') },
    alt: 'A potted plant in the wind',
    view: ['20deg 78deg auto', undefined, '30deg'],
    attributes: { loop: '', autoplay: '', ...clicked },
    words: 'A deformation field (4DGS) moves the splats over time. It runs on your GPU.',
    credit: TRAINED,
  },
  {
    ...{ id: 'person', kind: 'generator', title: 'A person to pose', src: model('walker') },
    alt: 'A person in a striped shirt',
    view: ['25deg 82deg 95%', undefined, '30deg'],
    attributes: { 'control-shape': '0.4', 'controls-panel': '', ...clicked },
    words: 'An avatar with 53 joints. Pose and shape are inputs of the model.',
    credit: `${TRAINED} The body is MakeHuman’s, CC0.`,
  },
  {
    ...{ id: 'portrait', kind: 'generator', title: 'Your photograph as a relief', src: model('portrait') },
    alt: 'A portrait of an astronaut as a relief',
    view: ['0deg 90deg 2.6m', '0m 0m -0.2m', '45deg'],
    attributes: { 'control-image': 'generators/portrait/image.png', 'controls-panel': '', ...clicked },
    webcam: true,
    words:
      'It finds the face, and makes a relief of the photograph. Choose your own, or use the webcam. Nothing is uploaded. Hair and wall are a guess.',
    credit: 'Networks by Google MediaPipe, Apache-2.0; photograph by NASA.',
  },
  {
    ...{ id: 'two-images', kind: 'generator', title: 'A scene from two images', src: model('statue') },
    alt: 'A statue, seen from between its two images',
    view: ['0deg 90deg 3.2m', '0m 0m -3.2m', '39.3deg'],
    attributes: clicked,
    inputs: 'generators/statue/view.json',
    words:
      'A feed-forward network predicts a Gaussian for each pixel of two images. It was not trained on this statue.',
    credit: TRAINED,
  },
  {
    ...{ id: 'vessel', kind: 'generator', title: 'Noise becomes a vessel', src: model('vessels') },
    alt: 'A vessel that appears from noise',
    view: ['20deg 68deg 5m', '0m 0m 0m', '30deg'],
    attributes: { autoplay: '', loop: '', 'control-seed': '5', ...clicked },
    hasSeeds: true,
    words:
      'A diffusion model removes the noise of 3,072 Gaussians in steps. It is small, 0.9 million weights, and makes vessels only: it learned from 30,000 of our own formula. Each seed is another.',
    credit: TRAINED,
  },
];

const POSTERS = 'demo/scenes/posters';
/** Attributes that name files of the site. */
const ADDRESSES = ['src', 'walk-map', 'control-image', 'poster'];

export default function gallery() {
  const path = join(root, POSTERS, 'counts.json');
  const counts = existsSync(path) ? JSON.parse(readFileSync(path, 'utf8')) : {};
  return SCENES.map((scene, i) => {
    const [orbit, target, angle] = scene.view;
    const view = { 'camera-orbit': orbit, 'camera-target': target, 'field-of-view': angle };
    const all = { src: scene.src, alt: scene.alt, 'camera-controls': '', ...scene.attributes, ...view };
    const attributes = Object.entries(all).filter(([, value]) => value !== undefined);
    const poster = `scenes/posters/${scene.id}.webp`;
    return {
      ...scene,
      poster,
      size: sizeOf(scene.src),
      splats: counts[scene.id]?.toLocaleString('en'),
      tag: tagOf(attributes, (file) => `../../${file}`, ' '),
      children: doorsOf(scene, (file) => `../../${file}`),
      code: `<gaussian-splat ${tagOf(attributes, shortOf, '\n  ')}>${doorsOf(scene, shortOf)}</gaussian-splat>`,
      playground: new URLSearchParams(
        attributes.map(([name, value]) => [name, pathIn(name, value, (file) => `../${file}`)]),
      ),
      next: SCENES[(i + 1) % SCENES.length],
    };
  });
}

const shortOf = (file) => (basename(file).startsWith('model.') ? `${file.split('/').at(-2)}.onnx` : basename(file));
const pathIn = (name, value, addressOf) => (ADDRESSES.includes(name) ? addressOf(value) : value);
const tagOf = (attributes, addressOf, space) =>
  attributes.map(([name, value]) => (value === '' ? name : `${name}="${pathIn(name, value, addressOf)}"`)).join(space);

/** Children that lead to other scenes: the slots of labels, with the rooms on both sides. */
const doorsOf = ({ doors = [] }, addressOf) =>
  doors
    .map(([room, to, position, heading, label, view], i) => {
      const [from, behind, map] = [`${room}.spz`, `${to}.spz`, `${to}.floor`].map((name) =>
        addressOf(`scenes/studio/${name}`),
      );
      const arrival = view === undefined ? '' : ` data-arrival-heading="${view}"`;
      return `\n  <button slot="hotspot-${i}" data-position="${position}" data-heading="${heading}"${arrival}\n    data-room="${from}" data-door="${behind}" data-floor-map="${map}">${label}</button>`;
    })
    .join('') + (doors.length > 0 ? '\n' : '');

/** Megabytes of a scene: of its file, or of its folder if it is streamed. */
function sizeOf(src) {
  const path = [join(root, 'demo', src), join(root, 'demo/dist', src)].find(existsSync);
  if (path === undefined) return '';
  const folder = join(path, '..');
  const files = path.endsWith('.json')
    ? readdirSync(folder, { recursive: true, withFileTypes: true })
        .filter((entry) => entry.isFile())
        .map(({ parentPath, name }) => join(parentPath, name))
    : [path];
  return `${(files.reduce((sum, file) => sum + statSync(file).size, 0) / 1e6).toFixed(1)} MB`;
}
