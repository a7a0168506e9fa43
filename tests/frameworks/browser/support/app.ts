/** The same app in any framework, driven as a person would. */
import { executeServerCommand } from '@web/test-runner-commands';
import { assert, assertEqual, COMPASS, delay, nextEvent, until } from '../../../element/browser/support/harness.js';

interface Splat extends HTMLElement {
  readonly loaded: boolean;
  readonly src: string;
  currentTime: number;
  readonly cameraControls: boolean;
  getCameraOrbit(): { readonly theta: number };
}
type Scope = Window & {
  readonly GPUDevice: typeof GPUDevice;
  readonly GPUBuffer: typeof GPUBuffer;
  readonly GPUAdapter: typeof GPUAdapter;
};

class App {
  readonly scope: Scope;
  readonly #page: Document;

  constructor(frame: HTMLIFrameElement) {
    this.#page = frame.contentDocument!;
    this.scope = frame.contentWindow as unknown as Scope;
  }

  get splat(): Splat | null {
    return this.#page.querySelector<Splat>('gaussian-splat');
  }

  text(id: string): string {
    return this.#page.getElementById(id)?.textContent ?? '';
  }

  click(id: string): void {
    this.#page.getElementById(id)?.click();
  }

  async shown(name: string, loads: number): Promise<Splat> {
    const isShown = (): boolean => Number(this.text('loads')) >= loads && this.text('status').includes(name);
    await until(isShown, `load ${loads}`, 50_000);
    assert(this.splat?.loaded, 'loaded');
    return this.splat;
  }
}

/** Elements that may still be held: React keeps the trees of its last two renderings, and a stack or a frame has another. A leak holds all of them. */
const MAX_HELD = 4;

/** An app and its known properties. */
export interface AppUnderTest {
  /** Its address. */
  readonly page: string;
  /** How often it is mounted in the test of leaks. */
  readonly mounts: number;
  /** How often React calls the effects of one mount, in a React app. */
  readonly effects?: number;
}

/** A scene that moves: three frames of a tenth of a second. */
const MOVING = '/net/sequence/three.json?count=3&fps=10';

async function open(page: string): Promise<App> {
  const frame = document.createElement('iframe');
  const scenes = new URLSearchParams({ first: COMPASS, second: MOVING });
  frame.src = `${page}?${scenes}`;
  frame.style.cssText = 'width: 300px; height: 400px; border: 0';
  const loaded = nextEvent(frame, 'load');
  document.body.append(frame);
  await loaded;
  return new App(frame);
}

/** Actions of an app with the element when a person drives it, in any framework. */
export function describeApp(name: string, { page, mounts, effects }: AppUnderTest): void {
  describe(`an app of ${name}`, () => {
    it('shows a scene once: properties by reference, events, a ref, children in slots', async () => {
      const app = await open(page);
      const splat = await app.shown('compass', 1);
      assertEqual([app.text('loads'), splat.cameraControls], ['1', true], 'loads, camera-controls');
      if (effects !== undefined) assertEqual(app.text('mounts'), String(effects), 'mounts by React');
      app.click('view');
      await until(() => app.text('where') !== '', 'the words of the ref');
      assertEqual(app.text('where'), `${String(splat.getCameraOrbit())}, controls by reference: true`);
      assertEqual(splat.querySelector('button')?.assignedSlot?.name, 'hotspot-forehead', 'the hotspot');
      splat.setAttribute('camera-orbit', '40deg 75deg auto');
      await until(() => Number(app.text('moves')) > 3, 'camera-change');
      // The app renders at each of these events, with the orbit of before among its properties.
      await until(() => Math.abs(splat.getCameraOrbit().theta - (40 * Math.PI) / 180) < 1e-2, 'the new orbit');
    });

    it('swaps its source on the same element, and is notified of the time of an animated scene', async () => {
      const app = await open(page);
      const before = await app.shown('compass', 1);
      app.click('swap');
      const splat = await app.shown('three', 2);
      assertEqual([splat === before, app.text('loads')], [true, '2'], 'the same element, one more load');
      const times = Number(app.text('times'));
      splat.currentTime = 0.2;
      await until(() => Number(app.text('times')) > times, 'timeupdate');
    });

    it('reports an error with its code', async () => {
      const app = await open(page);
      const splat = await app.shown('compass', 1);
      splat.setAttribute('src', '/net/status/404');
      await until(() => app.text('status').startsWith('network: '), 'the error');
    });

    it(`${mounts} mounts leave one device, not a buffer and not an element`, async () => {
      const app = await open(page);
      await app.shown('compass', 1);
      const alive = new Set<object>();
      let devices = 0;
      const { GPUDevice, GPUBuffer, GPUAdapter } = app.scope;
      const { createBuffer } = GPUDevice.prototype;
      GPUDevice.prototype.createBuffer = function booked(this: GPUDevice, descriptor) {
        const buffer = createBuffer.call(this, descriptor);
        alive.add(buffer);
        return buffer;
      };
      const { destroy } = GPUBuffer.prototype;
      GPUBuffer.prototype.destroy = function booked(this: GPUBuffer) {
        alive.delete(this);
        return destroy.call(this);
      };
      const { requestDevice } = GPUAdapter.prototype;
      GPUAdapter.prototype.requestDevice = function counted(this: GPUAdapter, descriptor) {
        devices++;
        return requestDevice.call(this, descriptor);
      };
      const Class = app.splat!.constructor as unknown as { releaseDelay: number };
      Class.releaseDelay = 0;
      // A second element, of the page's own, keeps the device, so that what belongs to the device is not counted.
      const resident = app.scope.document.createElement('gaussian-splat') as Splat;
      Object.assign(resident, { src: COMPASS, loading: 'eager' });
      app.scope.document.body.append(resident);
      await until(() => resident.loaded, 'the resident');
      app.click('toggle');
      await until(() => app.text('toggle') === 'Bring it back' && resident.loaded, 'the first unmount');
      await until(() => resident.loaded, 'the resident');
      const before = alive.size;
      const elements: WeakRef<Splat>[] = [];
      for (let i = 0; i < mounts; i++) {
        app.click('toggle');
        await until(() => app.text('toggle') === 'Take it away', `mount ${i}`);
        elements.push(new WeakRef(appSplat(app, resident)!));
        if (i % 20 === 0) await until(() => appSplat(app, resident)?.loaded === true, `the scene of mount ${i}`);
        app.click('toggle');
        await until(() => app.text('toggle') === 'Bring it back', `unmount ${i}`);
      }
      await until(() => alive.size <= before, `the buffers to go: ${alive.size} instead of ${before}`);
      assert(devices === 0, `${devices} more devices`);
      const held = async (): Promise<number> => {
        await executeServerCommand('heap-size');
        return elements.filter((element) => element.deref()).length;
      };
      let count = await held();
      for (let tries = 0; count > MAX_HELD && tries < 5; tries++) {
        await delay(400);
        count = await held();
      }
      console.log(`${name}: ${count} of ${mounts} elements are held`);
      assert(count <= MAX_HELD, `${count} elements are still held`);
    }).timeout(400_000);
  });
}

/** The app's own element, which stands before the resident. */
const appSplat = (app: App, resident: Splat): Splat | null => (app.splat === resident ? null : app.splat);
