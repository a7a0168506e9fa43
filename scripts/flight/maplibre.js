/** The layer of MapLibre of `npm run lab -- flight --in maplibre`, on an empty map. It is bundled with its worker, which sorts. */
import { Map as MapLibre, setWorkerUrl } from 'maplibre-gl';
import { SplatLayer } from '../../demo/map/splat-layer.js';

const PLACE = [13.4, 52.52];
/** A unit of the tileset in meters, and a degree of longitude and of latitude. */
const METERS = 10;
const DEGREES = [111_319.49 * Math.cos((PLACE[1] * Math.PI) / 180), 111_319.49];
const STYLE = {
  version: 8,
  sources: {},
  layers: [{ id: 'ground', type: 'background', paint: { 'background-color': '#fff' } }],
};

/** Place on the map of one in the element's axes, which point to the east, up and to the south. */
const lngLat = ([x, , z]) => [PLACE[0] + (METERS * x) / DEGREES[0], PLACE[1] - (METERS * z) / DEGREES[1]];

export async function open({ src, maxSplats, width, height, place }) {
  const container = document.createElement('div');
  container.style.cssText = `width: ${width}px; height: ${height}px`;
  document.body.append(container);
  setWorkerUrl('/map/maplibre-gl-worker.mjs');
  const map = new MapLibre({
    ...{ container, style: STYLE, center: PLACE, zoom: 18, maxPitch: 89, pixelRatio: 1, fadeDuration: 0 },
    ...{ attributionControl: false, canvasContextAttributes: { antialias: false } },
  });
  let failure;
  map.on('error', ({ error }) => (failure ??= error));
  await map.once('load');
  /** Maps look at a point of the ground: the direction of the path, 85 degrees from straight down. */
  const fly = (s) => {
    const [[x, y, z], ahead] = [place(s), place(s + 0.02)];
    const [east, south] = [ahead[0] - x, ahead[2] - z];
    const reach = (11 * y) / Math.hypot(east, south);
    const target = [x + reach * east, 0, z + reach * south];
    map.jumpTo(map.calculateCameraOptionsFromTo(lngLat([x, y, z]), METERS * y, lngLat(target), 0));
    map.triggerRepaint();
    const axis = [target[0] - x, -y, target[2] - z];
    return axis.map((value) => value / Math.hypot(...axis));
  };
  const worker = new Worker('/map/sorter.js', { type: 'module' });
  const layer = new SplatLayer({ id: 'city', src, lngLat: PLACE, metersPerUnit: METERS, maxSplats, worker });
  let drawMs = 0;
  const draw = layer.render;
  layer.render = function (...all) {
    const began = performance.now();
    draw.apply(this, all);
    drawMs = performance.now() - began;
  };
  fly(0);
  map.addLayer(layer);
  await layer.loaded;
  if (!layer.splats) throw failure ?? new Error('the tileset did not load');
  const gl = map.getCanvas().getContext('webgl2');
  return {
    fly,
    progress: () => ({ ...layer.splats.progress, drawMs }),
    facts() {
      if (failure) throw failure;
      return { megabytes: { scene: layer.splats.progress.bytes / 1e6 }, renderer: gl.getParameter(gl.RENDERER) };
    },
  };
}
