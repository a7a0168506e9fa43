/** A skull that stands on a map, beside a building that hides it. The tiles are made here. */
import { addProtocol, Map as MapLibre, setWorkerUrl } from 'maplibre-gl';
import { SplatLayer } from './splat-layer.js';

const PLACE = [13.4, 52.52];
/** Meters. */
const METERS_PER_DEGREE = [67_700, 111_300];
const notice = document.getElementById('notice');
if (!document.createElement('canvas').getContext('webgl2'))
  notice.textContent = 'This page needs WebGL 2, which this browser does not offer.';
setWorkerUrl(new URL('maplibre-gl-worker.mjs', document.baseURI).href);

const at = (east, north) => [PLACE[0] + east / METERS_PER_DEGREE[0], PLACE[1] + north / METERS_PER_DEGREE[1]];
const block = (west, south, east, north, height) => ({
  type: 'Feature',
  properties: { height },
  geometry: {
    type: 'Polygon',
    coordinates: [[at(west, south), at(east, south), at(east, north), at(west, north), at(west, south)]],
  },
});

/** A tile of a checkered ground. */
addProtocol('checks', async () => {
  const canvas = new OffscreenCanvas(256, 256);
  const context = canvas.getContext('2d');
  for (let square = 0; square < 64; square++) {
    const [column, row] = [square % 8, Math.floor(square / 8)];
    context.fillStyle = (column + row) % 2 === 0 ? '#dfe5da' : '#cdd8c6';
    context.fillRect(32 * column, 32 * row, 32, 32);
  }
  return { data: await (await canvas.convertToBlob()).arrayBuffer() };
});

const map = new MapLibre({
  container: 'map',
  style: {
    version: 8,
    sources: {
      ground: { type: 'raster', tiles: ['checks://{z}/{x}/{y}'], tileSize: 256 },
      blocks: {
        type: 'geojson',
        data: { type: 'FeatureCollection', features: [block(14, -24, 30, -8, 30), block(-70, 20, -40, 40, 18)] },
      },
    },
    layers: [
      { id: 'ground', type: 'raster', source: 'ground' },
      {
        id: 'blocks',
        type: 'fill-extrusion',
        source: 'blocks',
        paint: { 'fill-extrusion-color': '#b98b6b', 'fill-extrusion-height': ['get', 'height'] },
      },
    ],
  },
  center: PLACE,
  zoom: 18,
  pitch: 65,
  bearing: -30,
  maxPitch: 80,
  canvasContextAttributes: { antialias: true },
});
map.on('error', ({ error }) => (notice.textContent = `This map cannot be shown here: ${error.message}`));
map.on('load', async () => {
  const layer = new SplatLayer({
    id: 'skull',
    src: '../scenes/skull.spz',
    lngLat: PLACE,
    altitude: 18,
    metersPerUnit: 20,
  });
  map.addLayer(layer);
  await layer.loaded;
  if (layer.splats) notice.remove();
});
const turn = document.getElementById('turn');
turn.addEventListener('click', () => {
  if (map.isRotating()) map.stop();
  else map.rotateTo(map.getBearing() + 180, { duration: 10_000, easing: (share) => share });
});
/** For tests. */
globalThis.map = map;
