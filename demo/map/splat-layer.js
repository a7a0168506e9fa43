/** Gaussian splats as a custom layer of MapLibre GL JS: they stand at a place of the earth, and buildings of the map hide them. */
import { cameraFromClip, multiply } from '@gaussian-splat/core';
import { fetchScene, readScene } from '@gaussian-splat/formats';
import { packGaussians } from '@gaussian-splat/renderer';
import { GlHost } from '@gaussian-splat/renderer/webgl';
import { MercatorCoordinate } from 'maplibre-gl';

export class SplatLayer {
  type = 'custom';
  renderingMode = '3d';

  /** @param metersPerUnit length of a unit of the scene's file */
  constructor({ id, src, lngLat, altitude = 0, metersPerUnit = 1 }) {
    this.id = id;
    this.src = src;
    const place = MercatorCoordinate.fromLngLat(lngLat, altitude);
    const { x, y, z } = place;
    const size = metersPerUnit * place.meterInMercatorCoordinateUnits();
    // Columns. Captures have x to the right, y down and z forward: east, down and north on the map, whose y points south.
    this.placement = [size, 0, 0, 0, 0, 0, -size, 0, 0, -size, 0, 0, x, y, z, 1];
  }

  onAdd(map, gl) {
    this.map = map;
    this.host = new GlHost(gl);
    this.loaded = this.load().catch((error) => map.fire('error', { error }));
  }

  async load() {
    const { host } = this;
    const splats = await host.load(packGaussians(await readScene(await fetchScene(this.src))));
    // The map may have removed the layer meanwhile.
    if (host !== this.host) return splats.destroy();
    this.splats = splats;
    this.map.triggerRepaint();
  }

  render(gl, { defaultProjectionData }) {
    if (!this.splats) return;
    // Arrays of columns are rows of the transposed matrix: products come in the opposite order.
    const matrix = multiply(this.placement, defaultProjectionData.mainMatrix);
    const { drawingBufferWidth: width, drawingBufferHeight: height } = gl;
    const camera = cameraFromClip(matrix, { width, height, clipDepth: '-1..1' });
    const framebuffer = gl.getParameter(gl.FRAMEBUFFER_BINDING);
    if (!this.splats.draw(camera, { framebuffer })) this.map.triggerRepaint();
  }

  onRemove() {
    this.splats?.destroy();
    this.host.destroy();
    this.splats = this.host = undefined;
  }
}
