/** Splats as a layer of MapLibre: at their place, without errors of WebGL, while the map turns. */
import { Map as MapLibre, setWorkerUrl, type CustomLayerInterface } from 'maplibre-gl';
import type { GaussianCloud } from '@gaussian-splat/core';
import type { HostedSplats } from '@gaussian-splat/renderer/webgl';
import { assert, assertEqual } from '../../element/browser/support/harness.js';
import { splatTileset } from '../../support/tileset.js';

setWorkerUrl('/node_modules/maplibre-gl/dist/maplibre-gl-worker.mjs');
const PLACE: [number, number] = [13.4, 52.52];

interface Layer {
  readonly loaded: Promise<void>;
  readonly splats: HostedSplats;
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

  it('stream a tileset at its place on the Earth: the tiles that the view needs, and no more than fit', async () => {
    const { SplatLayer } = (await import('/demo/map/splat-layer.js' as string)) as { SplatLayer: LayerClass };
    for (const { maxSplats, isWhole } of [
      { maxSplats: undefined, isWhole: true },
      { maxSplats: 12 * 1024, isWhole: false },
    ]) {
      const address = `/net/kept/map-${crypto.randomUUID()}/`;
      for (const [path, bytes] of splatTileset(redCube(), { levels: 3, transform: onEarth() }))
        await fetch(address + path, { method: 'PUT', body: bytes.slice() });
      const log = async (): Promise<string[]> => (await (await fetch(`${address}log`)).json()) as string[];
      const map = await openMap(false);
      const errors: unknown[] = [];
      map.on('error', ({ error }) => errors.push(error));
      map.setZoom(10);
      const layer = new SplatLayer({ id: 'cube', src: `${address}tileset.json`, maxSplats });
      map.addLayer(layer);
      await layer.loaded;
      const settled = async (): Promise<void> => {
        for (let calm = 0; calm < 3;) {
          const drawn = map.once('render');
          map.triggerRepaint();
          await drawn;
          await new Promise((resolve) => setTimeout(resolve, 60));
          calm = layer.splats.progress!.coming === 0 ? calm + 1 : 0;
        }
      };
      await settled();
      const afar = await log();
      assertEqual(afar.join(' '), 'tileset.json 0/0-0.glb', 'requests from afar');
      map.setZoom(17.5);
      const gl = map.getCanvas().getContext('webgl2')!;
      await settled();
      for (const bearing of [0, 120, 240]) {
        map.jumpTo({ bearing });
        await map.once('render');
        assertEqual([gl.getError(), String(errors)], [gl.NO_ERROR, ''], `errors at ${bearing} degrees`);
        const [seen, place] = [splatsIn(map), map.project(PLACE)];
        const text = `${bearing} degrees: ${JSON.stringify(seen)}, the place is ${place.x} ${place.y}`;
        assert(seen.count > 300 && Math.hypot(seen.x - place.x, seen.y - place.y) < 10, text);
      }
      await settled();
      const near = await log();
      const { limit, resident, error } = layer.splats.progress!;
      const text = `${resident} pages, ${error} px, ${limit}; ${near.join(' ')}`;
      assertEqual(new Set(near).size, near.length, `each file once: ${text}`);
      if (isWhole) assert(limit === null && near.some((path) => path.startsWith('2/')), text);
      else assert(limit === 'memory' && resident <= 12, text);
      map.remove();
    }
  });
});

/** Splats of a cube along a side. */
const SIDE = 9;

/** A red cube of 24 m around its origin, in the frame of glTF. */
function redCube(): GaussianCloud {
  const count = SIDE ** 3;
  const positions = Float32Array.from({ length: 3 * count }, (_, n) => {
    const i = Math.floor(n / 3);
    return 3 * ([i % SIDE, Math.floor(i / SIDE) % SIDE, Math.floor(i / SIDE ** 2)][n % 3] - 4);
  });
  const each = (...values: number[]): Float32Array =>
    Float32Array.from({ length: values.length * count }, (_, n) => values[n % values.length]);
  return {
    ...{ count, positions, scales: each(1.8, 1.8, 1.8), rotations: each(1, 0, 0, 0), opacities: each(0.999) },
    ...{ sh: each(1, -1.5, -1.6), shDegree: 0, antialiased: false, droppedCount: 0, origin: [0, 0, 0] },
  };
}

/** Transform from east, north, up at {@link PLACE}, on the ellipsoid of WGS 84, to earth-centered coordinates. */
function onEarth(): number[] {
  const [lon, lat] = PLACE.map((degree) => (degree * Math.PI) / 180);
  const [a, b] = [6_378_137, 6_356_752.314_245];
  const up = [Math.cos(lat) * Math.cos(lon), Math.cos(lat) * Math.sin(lon), Math.sin(lat)];
  const north = [-Math.sin(lat) * Math.cos(lon), -Math.sin(lat) * Math.sin(lon), Math.cos(lat)];
  const length = Math.hypot(a * Math.cos(lat), b * Math.sin(lat));
  const place = [a, a, b].map((axis, k) => (axis ** 2 * up[k]) / length);
  return [-Math.sin(lon), Math.cos(lon), 0, 0, ...north, 0, ...up, 0, ...place, 1];
}
