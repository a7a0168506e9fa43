/** A scene of the gallery: its cost here, its code, the images and seeds of its network, and the webcam. */
import { copy } from '../site/copy.js';
import { fillCostCard } from '../site/cost-card.js';

const scene = document.querySelector('gaussian-splat');
const find = (name) => document.querySelector(`[data-${name}]`);

const card = find('facts');
fillCostCard(card, Object.entries(JSON.parse(card.dataset.facts)), scene);

find('copy').addEventListener('click', async () => {
  find('copied').textContent = await copy(document.querySelector('pre code').textContent);
});

/** Images of a network, and what their cameras have to do with one another. */
async function giveInputs(address) {
  const url = new URL(address, document.baseURI);
  const { images, controls } = await (await fetch(url)).json();
  const addresses = Object.entries(images).map(([name, file]) => [name, new URL(file, url).href]);
  scene.inputValues = { ...Object.fromEntries(addresses), ...controls };
}
if (scene.dataset.inputs) giveInputs(scene.dataset.inputs).catch((error) => console.error(error));

/** A generator of noise begins again with another seed. */
find('seeds')?.addEventListener('click', () => {
  scene.setAttribute('control-seed', Number(scene.getAttribute('control-seed')) + 1);
  scene.currentTime = 0;
  scene.dismissPoster();
  scene.play();
});

/** Frames of the webcam go to the model on this device, and nowhere else. */
find('webcam')?.addEventListener('click', async ({ target }) => {
  try {
    const video = document.createElement('video');
    video.srcObject = await navigator.mediaDevices.getUserMedia({ video: { width: 480, height: 480 } });
    video.muted = true;
    await video.play();
    scene.inputValues = { ...scene.inputValues, image: video };
    scene.dismissPoster();
    target.remove();
  } catch (error) {
    find('webcam-state').textContent = `No webcam: ${error.message}`;
  }
});
