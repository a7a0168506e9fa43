/**
 * Gaussian splats as a custom layer of MapLibre GL JS: they stand at a place of the earth, and buildings of the map hide them.
 * Scenes with levels of detail are streamed by view.
 */
import { cameraFromClip, multiply } from '@gaussian-splat/core';
import { openPages } from '@gaussian-splat/element/pages.js';
import { fetchScene, readScene } from '@gaussian-splat/formats';
import { packGaussians } from '@gaussian-splat/renderer';
import { GlHost } from '@gaussian-splat/renderer/webgl';
import { MercatorCoordinate } from 'maplibre-gl';

/**
 * Transform from a scene to the map, column by column.
 * @param axes of the scene that point to the east, to the north and up
 */
function placementAt(lngLat, altitude, metersPerUnit, [east, north, up]) {
  const place = MercatorCoordinate.fromLngLat(lngLat, altitude);
  const size = metersPerUnit * place.meterInMercatorCoordinateUnits();
  // The map's y points south.
  const column = (axis) => [size * east[axis], -size * north[axis], size * up[axis], 0];
  return [...column(0), ...column(1), ...column(2), place.x, place.y, place.z, 1];
}

/** The same for a scene around a point in earth-centered coordinates of WGS 84. @param origin in a cloud's axes: -x, -z, -y */
function placementOnEarth(origin) {
  const [x, y, z] = [-origin[0], -origin[2], -origin[1]];
  const [radius, eccentricity] = [6_378_137, 6.694_379_990_141_3e-3];
  const flat = Math.hypot(x, y);
  const lon = Math.atan2(y, x);
  let lat = Math.atan2(z, flat * (1 - eccentricity));
  let normal = radius;
  for (let k = 0; k < 5; k++) {
    normal = radius / Math.sqrt(1 - eccentricity * Math.sin(lat) ** 2);
    lat = Math.atan2(z + eccentricity * normal * Math.sin(lat), flat);
  }
  const altitude = flat / Math.cos(lat) - normal;
  const ofCloud = ([a, b, c]) => [-a, -c, -b];
  const axes = [
    [-Math.sin(lon), Math.cos(lon), 0],
    [-Math.sin(lat) * Math.cos(lon), -Math.sin(lat) * Math.sin(lon), Math.cos(lat)],
    [Math.cos(lat) * Math.cos(lon), Math.cos(lat) * Math.sin(lon), Math.sin(lat)],
  ].map(ofCloud);
  return placementAt([(180 * lon) / Math.PI, (180 * lat) / Math.PI], altitude, 1, axes);
}

const STREAMED = /(^|\/)(detail|lod-meta|tileset)\.json$|\.(lcc2?|rad)$/i;

export class SplatLayer {
  type = 'custom';
  renderingMode = '3d';

  /**
   * @param lngLat place of the scene; by default that of its file, if that has earth-centered coordinates (3D Tiles)
   * @param metersPerUnit length of a unit of the scene's file
   * @param maxSplats of a streamed scene on the GPU; default: one million
   * @param detail maximum error of a streamed scene, pixels; up to four times as much while frames are late
   * @param worker that sorts the splats, in place of the main thread: see `GlHostOptions`
   */
  constructor({ id, src, lngLat, altitude = 0, metersPerUnit = 1, maxSplats, detail = 1, worker }) {
    this.id = id;
    this.src = src;
    Object.assign(this, { maxSplats, detail, worker });
    // Captures have x to the right, y down and z forward: east, down and north.
    if (lngLat)
      this.placement = placementAt(lngLat, altitude, metersPerUnit, [
        [1, 0, 0],
        [0, 0, 1],
        [0, -1, 0],
      ]);
  }

  onAdd(map, gl) {
    this.map = map;
    // Layers of the style decide the range of depth; reading it in each frame would wait for the GPU process.
    map.on('styledata', (this.forget = () => (this.depthRange = undefined)));
    // MapLibre sets its own state after a custom layer.
    this.host = new GlHost(gl, { restores: false });
    this.loaded = this.load().catch((error) => map.fire('error', { error }));
  }

  async load() {
    const { host, src } = this;
    const { pathname } = new URL(src, document.baseURI);
    const splats = await (STREAMED.test(pathname) ? this.stream() : this.loadWhole());
    // The map may have removed the layer meanwhile.
    if (host !== this.host) return splats.destroy();
    this.splats = splats;
    this.map.triggerRepaint();
  }

  async loadWhole() {
    const cloud = await readScene(await fetchScene(new URL(this.src, document.baseURI)));
    this.placement ??= placementOnEarth(cloud.origin);
    // Float64 of the Earth is in the placement; what is left are meters around it.
    return this.host.load(packGaussians({ ...cloud, origin: [0, 0, 0] }), { worker: this.worker });
  }

  async stream() {
    const { maxSplats, worker, host, map } = this;
    const { source } = await openPages(this.src, { isExact: true });
    this.placement ??= placementOnEarth(source.scene.origin);
    const onError = (error) => map.fire('error', { error });
    const local = { ...source, scene: { ...source.scene, origin: [0, 0, 0] } };
    return host.stream(local, { maxSplats, worker, onError, onChange: () => map.triggerRepaint() });
  }

  render(gl, { defaultProjectionData }) {
    if (!this.splats) return;
    // Arrays of columns are rows of the transposed matrix: products come in the opposite order.
    const matrix = multiply(this.placement, defaultProjectionData.mainMatrix);
    const { drawingBufferWidth: width, drawingBufferHeight: height } = gl;
    const camera = cameraFromClip(matrix, { width, height, clipDepth: '-1..1' });
    const framebuffer = gl.getParameter(gl.FRAMEBUFFER_BINDING);
    this.depthRange ??= [...gl.getParameter(gl.DEPTH_RANGE)];
    if (
      !this.splats.draw(
        camera,
        { framebuffer, depthRange: this.depthRange },
        { detail: this.detail, frameMs: 1000 / 60 },
      )
    )
      this.map.triggerRepaint();
  }

  onRemove() {
    this.map.off('styledata', this.forget);
    this.splats?.destroy();
    this.host.destroy();
    this.splats = this.host = undefined;
  }
}
