/** Splats in a scene that three.js draws with its WebGLRenderer. */
import { cameraFromProjection } from '@gaussian-splat/core';
import { fetchScene, readScene } from '@gaussian-splat/formats';
import { packGaussians } from '@gaussian-splat/renderer';
import { GlHost } from '@gaussian-splat/renderer/webgl';
import * as THREE from 'three';
import { OrbitControls } from 'three/addons/controls/OrbitControls.js';

const canvas = document.getElementById('stage');
const notice = document.getElementById('notice');
if (!document.createElement('canvas').getContext('webgl2'))
  notice.textContent = 'This page needs WebGL 2, which this browser does not offer.';
const renderer = new THREE.WebGLRenderer({ canvas, antialias: true });
const gl = renderer.getContext();
const host = new GlHost(gl);

const scene = new THREE.Scene();
scene.background = new THREE.Color(0x20242b);
const bar = new THREE.Mesh(new THREE.BoxGeometry(3, 0.12, 0.12), new THREE.MeshStandardMaterial({ color: 0xd9822b }));
scene.add(bar, new THREE.HemisphereLight(0xffffff, 0x445566, 3));
/** Position of the splats: captures have y down. */
const place = new THREE.Object3D();
place.rotation.x = Math.PI;
scene.add(place);
const camera = new THREE.PerspectiveCamera(40, 1, 0.1, 50);
camera.position.set(1.6, 0.6, 2.6);
const controls = new OrbitControls(camera, canvas);
const modelView = new THREE.Matrix4();
const splats = await host.load(packGaussians(await readScene(await fetchScene('../scenes/skull.spz'))));

function draw() {
  renderer.render(scene, camera);
  modelView.multiplyMatrices(camera.matrixWorldInverse, place.matrixWorld);
  const size = { width: gl.drawingBufferWidth, height: gl.drawingBufferHeight };
  const view = cameraFromProjection(modelView.elements, camera.projectionMatrix.elements, {
    ...size,
    clipDepth: '-1..1',
  });
  if (!splats.draw(view)) requestAnimationFrame(draw);
}

new ResizeObserver(() => {
  const { clientWidth, clientHeight } = canvas;
  renderer.setPixelRatio(devicePixelRatio);
  renderer.setSize(clientWidth, clientHeight, false);
  camera.aspect = clientWidth / clientHeight;
  camera.updateProjectionMatrix();
  draw();
}).observe(canvas);
controls.addEventListener('change', draw);
notice.remove();
/** For tests. */
globalThis.turnTo = (x, y, z) => {
  camera.position.set(x, y, z);
  controls.update();
  draw();
  return gl.getError();
};
