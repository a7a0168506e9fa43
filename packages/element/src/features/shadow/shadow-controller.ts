/** Draws the shadow under the scene. Loaded for elements with the attribute `shadow-intensity`. */
import { eyeOf, Lazy, multiply, type Matrix4 } from '@gaussian-splat/core';
import { GaussianBuffers, type Placement } from '@gaussian-splat/renderer';
import type { ReactiveController } from 'lit';
import { toViewer, type ViewerFrame } from '../../viewer/camera/orbit.js';
import { matrixOfFrame, transposed } from '../../viewer/camera/placing.js';
import type { Feature } from '../../viewer/features.js';
import type { Viewer } from '../../viewer/viewer.js';
import type { Backend, DeviceOwner } from '../../gpu/backend.js';
import type { WebGpuBackend } from '../../gpu/webgpu-backend.js';
import type { Frame } from '../../sources/generator/frame-filter.js';
import { readShadow, shadowSplats, takeShadow, type ShadowMap, type TakeAlpha } from '../../shared/shadow-map.js';
import { packSplats } from '../../shared/splat-file.js';

/**
 * Limits for the shadow of a moving scene: the minimum interval between updates, milliseconds, and the minimum ratio of
 * the interval to the time of an update.
 */
const [MIN_MS, SHARE] = [500, 10];
/** Minimum ratio after an edit, such as a moved cut. */
const EDIT_SHARE = 1;
/**
 * Height of the camera above the ground, in radii of the subject, below which the shadow fades out. From below the
 * ground the shadow is invisible.
 */
const FADE = 0.08;

/** A shadow that is drawn in the world of an element. */
interface Shown {
  readonly context: DeviceOwner['context'];
  readonly map: ShadowMap;
  /** Transform from the square of the shadow to the world. */
  readonly toWorld: Matrix4;
  /** Sets the visibility of the shadow. @param opacity 0..1 */
  fade(opacity: number): void;
  remove(): void;
}

const isGl = ({ place }: Backend): boolean => place.context instanceof WebGL2RenderingContext;

/**
 * Captures images of the scene when it has changed, converts them to flat splats, and draws these splats under the
 * scene.
 */
export class ShadowController implements ReactiveController, Feature {
  readonly #core: Viewer;
  /** Key of the content that the current shadow was made for. */
  #key = '';
  #shown: Shown | undefined;
  #isBusy = false;
  /** Time of the last shadow and of its making, milliseconds, and the motion that it shows. */
  #madeAt = -Infinity;
  #makingMs = 0;
  #motion = '';
  #timer: ReturnType<typeof setTimeout> | undefined;
  readonly #gl = new Lazy(
    'the code of shadows',
    () => import('./gl-shadow.js'),
    () => this.#core.requestFrame(),
  );
  readonly #gpu = new Lazy(
    'the code of shadows',
    () => import('../../shared/take-alpha.js'),
    () => this.#core.requestFrame(),
  );

  constructor(core: Viewer) {
    this.#core = core;
    core.element.addController(this);
    // Without a scene no frame is drawn that would remove the shadow.
    core.element.addEventListener('emptied', () => core.view.backend === null && this.#remove());
  }

  hostUpdated(): void {
    this.#core.requestFrame();
  }

  hostDisconnected(): void {
    clearTimeout(this.#timer);
    this.#timer = undefined;
  }

  advance(now: number): boolean {
    const { view, isShownElsewhere } = this.#core;
    const { backend } = view;
    if (this.#shown && this.#shown.context !== backend?.place.context) this.#remove();
    if (!backend || backend.place.isLost || isShownElsewhere) return false;
    // Waits for the end of the task, because this frame may still cut or move splats.
    queueMicrotask(() => this.#follow(backend, now));
    this.#fade();
    return false;
  }

  #follow(backend: Backend, now: number): void {
    if (backend.place.isLost || backend.isDestroyed) return;
    const key = this.#contentKey();
    if (key === '') {
      if (this.#shown) this.#core.requestFrame();
      this.#remove();
    } else if (key !== this.#key && !this.#isBusy) {
      const code = isGl(backend) ? this.#gl : this.#gpu;
      if (code.want((error) => this.#warn(error))) this.#renew(backend, key, now);
    }
  }

  /** Text that changes whenever the shadow would change; empty without a shadow. */
  #contentKey(): string {
    const { sources } = this.#core;
    const { intensity, softness } = readShadow(this.#core);
    if (intensity === 0 || sources.members.length === 0 || sources.isPreview) return '';
    const places = sources.members.map(({ placement: { scene, sceneToWorld, visible, crop, opacity, modifier } }) => {
      const place = sceneToWorld ? Array.from(sceneToWorld).join() : '';
      return `${scene.count} ${scene.version} ${place} ${visible} ${crop ? [crop.min, crop.max].join() : ''} ${opacity} ${modifier?.version}`;
    });
    return [...places, sources.meshes.value?.version, intensity, softness].join('|');
  }

  /** Returns a text that changes with each run of a generator and each frame of a clip. */
  #motionKey(): string {
    return this.#core.sources.members.map(({ placement: { scene } }) => scene.version).join();
  }

  #warn({ message }: Error): void {
    this.#core.warn(`<gaussian-splat> shadow: ${message}`);
  }

  #renew(backend: Backend, key: string, now: number): void {
    const motion = this.#motionKey();
    const share = motion === this.#motion ? EDIT_SHARE : SHARE;
    const wait = Math.max(share * this.#makingMs, share === SHARE ? MIN_MS : 0);
    const notBefore = this.#madeAt + wait;
    if (now < notBefore) {
      // When a motion has ended, the shadow must show its last pose.
      this.#timer ??= setTimeout(() => {
        this.#timer = undefined;
        this.#core.requestFrame();
      }, notBefore - now);
      return;
    }
    this.#isBusy = true;
    this.#key = key;
    this.#motion = motion;
    const begin = performance.now();
    this.#make(backend)
      .catch((error: Error) => {
        if (!backend.place.isLost && !backend.isDestroyed) this.#warn(error);
      })
      .finally(() => {
        this.#isBusy = false;
        this.#madeAt = performance.now();
        this.#makingMs = this.#madeAt - begin;
        this.#core.requestFrame();
      });
  }

  async #make(backend: Backend): Promise<void> {
    const { sources, frame, services } = this.#core;
    const { bounds } = sources;
    const [scene] = sources.members.map((member) => member.scene);
    if (!bounds || !scene) return;
    const { center, radius } = bounds.subject ?? bounds;
    const { intensity, softness } = readShadow(this.#core);
    const taker = await this.#taker(backend);
    try {
      const map = await takeShadow({ center: toViewer(frame, center), radius, frame }, taker.take);
      if (map === null || backend.place.isLost || backend.isDestroyed) return this.#clear();
      const rows = shadowSplats(map, intensity, softness);
      if (rows.length === 0) return this.#clear();
      const packed = await packSplats(rows, services.sceneLoader, scene.signal);
      const shown = await taker.show(packed, map, worldOf(map, frame));
      if (backend.isDestroyed) return shown.remove();
      this.#shown?.remove();
      this.#shown = shown;
    } finally {
      taker.free();
    }
  }

  /** Returns the functions that capture images and draw shadows with the API of the backend. */
  async #taker(backend: Backend): Promise<Taker> {
    if (isGl(backend)) {
      const { glTaker } = await this.#gl.get();
      return glTaker(backend as Parameters<typeof glTaker>[0]);
    }
    const { alphaOfWorld } = await this.#gpu.get();
    const { sources } = this.#core;
    const { device, view } = backend as WebGpuBackend;
    const { take, free } = alphaOfWorld({
      ...{ device, members: sources.members, settings: view.settings, filter: view.filter },
      drawBeneath: (camera) => this.#core.drawBeneath({ camera } as Frame),
    });
    const show: Taker['show'] = async (packed, map, toWorld) => {
      const gaussians = await GaussianBuffers.upload(device, packed);
      const placement: Placement = sources.world.add({ scene: gaussians, sceneToWorld: toWorld });
      const remove = (): void => {
        sources.world.remove(placement);
        gaussians.destroy();
      };
      const fade = (opacity: number): void => void (placement.opacity = opacity);
      return { context: device, map, toWorld, fade, remove };
    };
    return { take, free, show };
  }

  #fade(): void {
    if (!this.#shown) return;
    const { map } = this.#shown;
    const { frame, camera } = this.#core;
    const [, height] = toViewer(frame, eyeOf(camera.view(1, 1).worldToCamera));
    this.#shown.fade(Math.min(1, Math.max(0, (height - map.middle[1]) / (FADE * map.half))));
  }

  #remove(): void {
    this.#key = '';
    this.#clear();
  }

  /** Removes the shadow until the content changes. */
  #clear(): void {
    this.#shown?.remove();
    this.#shown = undefined;
  }
}

/** Captures images of a scene's opacity, and draws shadows. */
export interface Taker {
  readonly take: TakeAlpha;
  show(packed: Parameters<typeof GaussianBuffers.upload>[1], map: ShadowMap, toWorld: Matrix4): Promise<Shown>;
  free(): void;
}

/** Returns the transform from the square of a shadow to the world. */
function worldOf({ middle: [x, y, z], half }: ShadowMap, frame: ViewerFrame): Matrix4 {
  const placed = [half, 0, 0, x, 0, half, 0, y, 0, 0, half, z, 0, 0, 0, 1];
  return multiply(transposed(matrixOfFrame(frame)), placed);
}
