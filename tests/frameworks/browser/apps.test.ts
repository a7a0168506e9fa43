/** Real apps of React (under StrictMode) and Vue, as their own tools have built them, driven as a person would. */
import { assert, assertEqual, COMPASS, FIXTURES, nextEvent, until } from '../../element/browser/support/harness.js';

interface Splat extends HTMLElement {
  readonly loaded: boolean;
  readonly src: string;
  readonly cameraControls: boolean;
  getCameraOrbit(): object;
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
    await until(() => Number(this.text('loads')) >= loads && this.text('status').includes(name), `load ${loads}`);
    assert(this.splat?.loaded, 'loaded');
    return this.splat;
  }
}

async function open(name: string): Promise<App> {
  const frame = document.createElement('iframe');
  const scenes = new URLSearchParams({ first: COMPASS, second: `${FIXTURES}green.splat` });
  frame.src = `/demo/dist/${name}/index.html?${scenes}`;
  frame.style.cssText = 'width: 500px; height: 500px; border: 0';
  const loaded = nextEvent(frame, 'load');
  document.body.append(frame);
  await loaded;
  return new App(frame);
}

for (const name of ['react', 'vue']) {
  describe(`an app of ${name}`, () => {
    it('shows a scene once: properties by reference, events, a ref, children in slots', async () => {
      const app = await open(name);
      const splat = await app.shown('compass', 1);
      assertEqual([app.text('loads'), splat.cameraControls], ['1', true], 'loads, camera-controls');
      app.click('view');
      await until(() => app.text('where') !== '', 'the words of the ref');
      assertEqual(app.text('where'), `${String(splat.getCameraOrbit())}, controls by reference: true`);
      assertEqual(splat.querySelector('button')?.assignedSlot?.name, 'hotspot-middle', 'the hotspot');
      splat.setAttribute('camera-orbit', '40deg 75deg auto');
      await until(() => Number(app.text('moves')) > 3, 'camera-change');
    });

    it('swaps its source on the same element', async () => {
      const app = await open(name);
      const before = await app.shown('compass', 1);
      app.click('swap');
      const after = await app.shown('green', 2);
      assertEqual([after === before, app.text('loads')], [true, '2'], 'the same element, one more load');
    });

    it('tells an error with its code', async () => {
      const app = await open(name);
      const splat = await app.shown('compass', 1);
      splat.setAttribute('src', '/net/status/404');
      await until(() => app.text('status').startsWith('network: '), 'the error');
    });

    it('200 mounts leave one device and not a buffer', async () => {
      const app = await open(name);
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
      for (let i = 0; i < 200; i++) {
        app.click('toggle');
        await until(() => app.text('toggle') === 'Take it away', `mount ${i}`);
        if (i % 20 === 0) await until(() => appSplat(app, resident)?.loaded === true, `the scene of mount ${i}`);
        app.click('toggle');
        await until(() => app.text('toggle') === 'Bring it back', `unmount ${i}`);
      }
      await until(() => alive.size === before, `the buffers to go: ${alive.size} instead of ${before}`);
      assert(devices === 0, `${devices} more devices`);
    }).timeout(120_000);
  });
}

/** The app's own element, which stands before the resident. */
const appSplat = (app: App, resident: Splat): Splat | null => (app.splat === resident ? null : app.splat);
