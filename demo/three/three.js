/** A captured skull in a three.js scene: a bar goes through it, a ring goes round it. */
import { fetchScene, readScene } from '@gaussian-splat/formats';
import { autotune, GaussianBuffers, packGaussians } from '@gaussian-splat/renderer';
import { SplatRenderer, SplatScene } from '@gaussian-splat/three';
import {
  BoxGeometry,
  Color,
  DirectionalLight,
  HemisphereLight,
  Mesh,
  MeshStandardMaterial,
  PerspectiveCamera,
  Scene,
  TorusGeometry,
  WebGPURenderer,
} from 'three/webgpu';
import { OrbitControls } from 'three/addons/controls/OrbitControls.js';

const canvas = document.getElementById('stage');
const notice = document.getElementById('notice');

try {
  await show();
} catch (error) {
  notice.textContent = `This page cannot be shown here: ${error.message}`;
}

async function show() {
  const renderer = new WebGPURenderer({ canvas });
  await renderer.init();
  const { device } = renderer.backend;
  // Without WebGPU three.js draws by WebGL, and the next line reports the reason.
  const splats = new SplatRenderer(renderer, { onIncomplete: () => draw() });
  await autotune(device);

  const cloud = await readScene(await fetchScene('../scenes/skull.spz'));
  const skull = new SplatScene(await GaussianBuffers.upload(device, packGaussians(cloud)));
  skull.rotation.x = Math.PI;

  const bar = new Mesh(new BoxGeometry(3, 0.12, 0.12), new MeshStandardMaterial({ color: 0xd9822b, roughness: 0.4 }));
  const ring = new Mesh(
    new TorusGeometry(0.95, 0.04, 24, 96),
    new MeshStandardMaterial({ color: 0x3f8fd2, metalness: 0.3 }),
  );
  ring.rotation.x = 1.2;
  const sun = new DirectionalLight(0xffffff, 2.5);
  sun.position.set(2, 3, 4);
  const scene = new Scene();
  scene.background = new Color(0x20242b);
  scene.add(skull, bar, ring, sun, new HemisphereLight(0xffffff, 0x445566, 1.5));

  const camera = new PerspectiveCamera(40, 1, 0.1, 50);
  camera.position.set(1.6, 0.6, 2.6);
  const controls = new OrbitControls(camera, canvas);

  function draw() {
    splats.render(scene, camera);
  }

  function resize() {
    const { clientWidth, clientHeight } = canvas;
    renderer.setPixelRatio(devicePixelRatio);
    renderer.setSize(clientWidth, clientHeight, false);
    camera.aspect = clientWidth / clientHeight;
    camera.updateProjectionMatrix();
    draw();
  }

  new ResizeObserver(resize).observe(canvas);
  controls.addEventListener('change', draw);
  document.getElementById('turn').addEventListener('input', ({ target }) => {
    bar.rotation.y = Number(target.value);
    ring.rotation.y = Number(target.value);
    draw();
  });
  notice.remove();
}
