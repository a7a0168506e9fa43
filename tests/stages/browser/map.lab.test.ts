/** Splats as a layer of MapLibre: at their place, without errors of WebGL, while the map turns. */
import { Map as MapLibre, setWorkerUrl, type CustomLayerInterface } from 'maplibre-gl';
import { assert, assertEqual } from '../../element/browser/support/harness.js';

setWorkerUrl('/node_modules/maplibre-gl/dist/maplibre-gl-worker.mjs');
const PLACE: [number, number] = [13.4, 52.52];

interface Layer {
  readonly loaded: Promise<void>;
}
type LayerClass = new (options: object) => Layer & CustomLayerInterface;

/** The gray block east of the splats is 40 m wide and 60 m high. */
const degrees = (east: number, north: number): [number, number] => [
  PLACE[0] + east / 67_700,
  PLACE[1] + north / 111_300,
];

async function openMap(hasBlock: boolean): Promise<MapLibre> {
  const container = document.createElement('div');
  container.style.cssText = 'width: 320px; height: 240px';
  document.body.append(container);
  const ring = [degrees(-40, -60), degrees(0, -60), degrees(0, -50), degrees(-40, -50), degrees(-40, -60)];
  const map = new MapLibre({
    container,
    style: {
      version: 8,
      sources: {
        block: {
          type: 'geojson',
          data: { type: 'Feature', properties: {}, geometry: { type: 'Polygon', coordinates: [ring] } },
        },
      },
      layers: [
        { id: 'ground', type: 'background', paint: { 'background-color': '#ffffff' } },
        ...(hasBlock
          ? [
              {
                ...({ id: 'block', type: 'fill-extrusion', source: 'block' } as const),
                paint: { 'fill-extrusion-color': '#808080', 'fill-extrusion-height': 120 },
              },
            ]
          : []),
      ],
    },
    ...{ center: PLACE, zoom: 17.5, pitch: 60, bearing: 0, attributionControl: false, fadeDuration: 0 },
    canvasContextAttributes: { antialias: true, preserveDrawingBuffer: true },
  });
  await map.once('load');
  return map;
}

/** Pixels darker than the white background and not gray: means of x and y in CSS pixels, and their number. */
function splatsIn(map: MapLibre): { x: number; y: number; count: number } {
  const canvas = map.getCanvas();
  const copy = new OffscreenCanvas(canvas.width, canvas.height).getContext('2d')!;
  copy.drawImage(canvas, 0, 0);
  const { data, width } = copy.getImageData(0, 0, canvas.width, canvas.height);
  let [x, y, count] = [0, 0, 0];
  for (let i = 0; i < data.length; i += 4) {
    if (data[i] - data[i + 2] < 60) continue;
    count++;
    x += (i / 4) % width;
    y += Math.floor(i / 4 / width);
  }
  const ratio = canvas.width / canvas.clientWidth;
  return { x: x / count / ratio, y: y / count / ratio, count };
}

/** A red cube of 24 m. */
const ball = (): Promise<Blob> => {
  const side = 9;
  const rows = new Float32Array(8 * side ** 3);
  const bytes = new Uint8Array(rows.buffer);
  for (let i = 0; i < side ** 3; i++) {
    const p = [i % side, Math.floor(i / side) % side, Math.floor(i / side ** 2)].map((k) => (k - 4) / 4);
    rows.set([...p, 0.15, 0.15, 0.15], 8 * i);
    bytes.set([200, 20, 10, 255, 255, 128, 128, 128], 32 * i + 24);
  }
  return Promise.resolve(new Blob([rows]));
};

describe('maps', () => {
  it('show splats at their place, hidden by a building, while the map turns', async () => {
    const { SplatLayer } = (await import('/demo/map/splat-layer.js' as string)) as { SplatLayer: LayerClass };
    const src = `${URL.createObjectURL(await ball())}#ball.splat`;
    const found: { x: number; y: number; count: number }[] = [];
    for (const hasBlock of [false, true]) {
      const map = await openMap(hasBlock);
      const errors: unknown[] = [];
      map.on('error', ({ error }) => errors.push(error));
      const layer = new SplatLayer({ id: 'ball', src, lngLat: PLACE, altitude: 0, metersPerUnit: 12 });
      map.addLayer(layer);
      await layer.loaded;
      const gl = map.getCanvas().getContext('webgl2')!;
      for (let bearing = 0; bearing < 360; bearing += 30) {
        map.jumpTo({ bearing });
        await map.once('render');
        assertEqual(gl.getError(), gl.NO_ERROR, `errors at ${bearing} degrees`);
        const seen = splatsIn(map);
        if (bearing === 0) found.push(seen);
        const place = map.project(PLACE);
        if (!hasBlock)
          assert(
            seen.count > 500 && Math.hypot(seen.x - place.x, seen.y - place.y) < 10,
            `${bearing} degrees: ${JSON.stringify(seen)} is not at ${place.x} ${place.y}`,
          );
      }
      assertEqual(errors.length, 0, String(errors));
      map.remove();
    }
    const [free, blocked] = found;
    assert(blocked.count < 0.7 * free.count && blocked.count > 0.3 * free.count, JSON.stringify(found));
    assert(blocked.x > free.x + 5, `the left half is hidden: ${JSON.stringify(found)}`);
  });
});
