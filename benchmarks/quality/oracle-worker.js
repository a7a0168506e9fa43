/** The float64 oracle of the tests, off the main thread. */
import { renderOracle } from '../../tests/oracle/oracle.ts';

onmessage = ({ data: { cloud, cameras } }) => {
  for (const { index, camera } of cameras) {
    const start = performance.now();
    const mode = cloud.antialiased ? 'antialiased' : 'classic';
    const { color, contributors } = renderOracle(cloud, camera, { rules: 'gsplat', mode });
    const image = { color: Float32Array.from(color), covered: Uint8Array.from(contributors, (n) => (n > 0 ? 1 : 0)) };
    postMessage({ index, image, milliseconds: performance.now() - start }, [image.color.buffer, image.covered.buffer]);
  }
};
