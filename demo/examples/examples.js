/** The page of trained examples: what each costs, read from its own files, and handles for time, pose and shape. */
import { resolveContract } from '@gaussian-splat/core/contract';
import { openUrl, readOnnxHeader } from '@gaussian-splat/core/onnx';
import { fillCostCard } from '../site/cost-card.js';
import { poseOf, walkingPose } from './poses.js';

const PACES_PER_SECOND = 0.9;
const folderOf = (name) => new URL(`../generators/${name}/`, document.baseURI);
const exampleOf = (name) => document.querySelector(`[data-example="${name}"]`);

/** Contract and size of a model, from its header alone, and the record of its training. */
async function readFacts(name) {
  const source = await openUrl(new URL('model.onnx', folderOf(name)));
  const header = await readOnnxHeader(source);
  const response = await fetch(new URL('record.json', folderOf(name)));
  return { bytes: source.size, contract: resolveContract({ header }).contract, record: await response.json() };
}

/** Facts known without running it: bytes, Gaussians, accuracy, training, license. */
function factsOf({ bytes, contract, record }) {
  const unseen = record.unseen ? `; ${record.unseen.psnr.toFixed(1)} dB on a scene that it never saw` : '';
  const inside = record.outline_psnr ? `; ${record.outline_psnr.toFixed(1)} dB inside the outline` : '';
  return [
    ['File', `${(bytes / 1e6).toFixed(2)} MB`],
    ...(contract.nMax ? [['Gaussians', contract.nMax.toLocaleString('en')]] : []),
    ['Held-out PSNR', `${record.held_out_psnr.toFixed(1)} dB${inside}${unseen}`],
    ['Trained', `${Math.round(record.seconds)} s on one ${record.device}, ${record.steps.toLocaleString('en')} steps`],
    ['License', `${contract.license}. ${contract.attribution}`],
  ];
}

/** Play, pause and a slider that follows. */
function conductTime(card) {
  const element = card.querySelector('gaussian-splat');
  const [button, slider] = [card.querySelector('[data-play]'), card.querySelector('[data-time]')];
  button.addEventListener('click', async () => {
    if (!element.paused) return element.pause();
    await element.play().catch((error) => (button.title = error.message));
  });
  for (const type of ['play', 'pause']) {
    element.addEventListener(type, () => {
      button.textContent = element.paused ? 'Play' : 'Pause';
      button.setAttribute('aria-pressed', String(!element.paused));
    });
  }
  element.addEventListener('timeupdate', () => (slider.value = element.currentTime));
  slider.addEventListener('input', () => {
    // The pause reports the time, which the slider follows.
    const wanted = slider.valueAsNumber;
    element.pause();
    element.currentTime = wanted;
  });
}

/** Pairs of images, with what their cameras have to do with one another: `view.json` beside them. */
async function conductImages(card) {
  const element = card.querySelector('gaussian-splat');
  const buttons = [...card.querySelectorAll('[data-pair]')];
  const choose = async (chosen) => {
    const folder = new URL(chosen.dataset.pair, folderOf(card.dataset.example));
    const view = await (await fetch(new URL('view.json', folder))).json();
    const addresses = Object.entries(view.images).map(([name, file]) => [name, new URL(file, folder).href]);
    element.inputValues = { ...Object.fromEntries(addresses), ...view.controls };
    card.querySelectorAll('.given img').forEach((image, i) => (image.src = addresses[i][1]));
    for (const button of buttons) button.setAttribute('aria-pressed', String(button === chosen));
  };
  for (const button of buttons) button.addEventListener('click', () => choose(button));
  await choose(buttons[0]);
}

/** Sliders for a pose, a button that walks. */
function conductWalker(card, joints) {
  const element = card.querySelector('gaussian-splat');
  const sliders = [...card.querySelectorAll('[data-handle]')];
  const [button, shape] = [card.querySelector('[data-walk]'), card.querySelector('[data-shape]')];
  let frame = 0;
  const pose = () => {
    const handles = Object.fromEntries(sliders.map((each) => [each.dataset.handle, each.valueAsNumber]));
    element.pose = poseOf(joints, handles);
  };
  const stop = () => {
    cancelAnimationFrame(frame);
    frame = 0;
    button.textContent = 'Walk';
    button.setAttribute('aria-pressed', 'false');
  };
  const step = (milliseconds) => {
    element.pose = walkingPose(joints, (milliseconds / 1000) * PACES_PER_SECOND);
    frame = requestAnimationFrame(step);
  };
  button.addEventListener('click', () => {
    if (frame !== 0) return stop();
    frame = requestAnimationFrame(step);
    button.textContent = 'Stand';
    button.setAttribute('aria-pressed', 'true');
  });
  for (const slider of sliders) {
    slider.addEventListener('input', () => {
      stop();
      pose();
    });
  }
  shape.addEventListener('input', () => element.setAttribute('control-shape', shape.value));
  pose();
}

/** Seconds for one round about the plinth, and how far from its middle. */
const ROUND_SECONDS = 14;
const ROUND_METERS = 1.35;
/** Its middle is above its feet. */
const HIP_METERS = 0.83;

/** The avatar walks around among a scene and a mesh. */
async function conductRound(card) {
  const walker = card.querySelector('#walker');
  const button = card.querySelector('[data-walk]');
  const { contract } = await readFacts('walker');
  const { joints } = contract.inputs.pose;
  let [frame, seconds, last] = [0, 0, 0];
  const put = () => {
    const angle = (2 * Math.PI * seconds) / ROUND_SECONDS;
    walker.position = [ROUND_METERS * Math.sin(angle), HIP_METERS, ROUND_METERS * Math.cos(angle)];
    walker.rotation = [0, angle + Math.PI / 2, 0];
    walker.pose = walkingPose(joints, seconds * PACES_PER_SECOND);
  };
  const step = (now) => {
    seconds += Math.min(0.1, (now - last) / 1000);
    last = now;
    put();
    frame = requestAnimationFrame(step);
  };
  put();
  button.addEventListener('click', () => {
    const walks = frame === 0;
    cancelAnimationFrame(frame);
    last = performance.now();
    frame = walks ? requestAnimationFrame(step) : 0;
    button.textContent = walks ? 'Stand' : 'Walk';
    button.setAttribute('aria-pressed', String(walks));
  });
}

/** Post-processors run on request: they are too slow for weak GPUs. */
function conductPainter(card, facts) {
  card.querySelector('[data-paint]').addEventListener('click', ({ target }) => {
    target.remove();
    const scene = card.querySelector('template').content.cloneNode(true).firstElementChild;
    card.querySelector('.words').before(scene);
    card.querySelector('img').remove();
    const status = card.querySelector('[role=status]');
    scene.addEventListener('generator-error', ({ detail }) => (status.textContent = detail.message));
    scene.addEventListener('generator-fallback', ({ detail }) => (status.textContent = `On the CPU: ${detail.reason}`));
    fillCostCard(card.querySelector('.cost'), facts, scene);
  });
}

/** A file's card needs no ONNX header: the page contains its known facts. */
function showFile(card) {
  const facts = Object.entries(JSON.parse(card.dataset.facts));
  fillCostCard(card.querySelector('.cost'), facts, card.querySelector('gaussian-splat'));
}

function showModel(card) {
  const name = card.dataset.example;
  readFacts(name).then(
    (read) => {
      const facts = factsOf(read);
      fillCostCard(card.querySelector('.cost'), facts, card.querySelector('gaussian-splat'));
      if (name === 'walker') conductWalker(card, read.contract.inputs.pose.joints);
      if (card.querySelector('[data-paint]')) conductPainter(card, facts);
    },
    (error) => (card.querySelector('.cost').textContent = error.message),
  );
}

for (const name of ['sequence', 'plant']) conductTime(exampleOf(name));
conductRound(exampleOf('together')).catch((error) => console.error(error));
conductImages(exampleOf('statue')).catch((error) => console.error(error));
for (const card of document.querySelectorAll('[data-example]')) {
  if (card.dataset.facts) showFile(card);
  else showModel(card);
}
