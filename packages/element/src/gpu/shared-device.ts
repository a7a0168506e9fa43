import { GaussianSplatError } from '@gaussian-splat/core';
import { MemoryLedger } from '@gaussian-splat/renderer';
import type { Place } from './painter.js';
import { requestGpuDevice, why } from './request-device.js';

/** How long a device is waited for, ms. */
const ANSWER_MS = 20_000;

/** A share in the page's GPU device. */
export interface DeviceLease extends Place {
  readonly device: GPUDevice;
  /** Gives the share back; the last one destroys the device. Further calls do nothing. */
  release(): void;
}

/** One device, and the leases that keep it. */
class DeviceSession {
  isLost = false;
  isClosed = false;
  readonly device: GPUDevice;
  /** Whom a loss is told. Not by one promise for all: it would hold on to everybody who ever waited for it. */
  readonly #listeners = new Set<(info: GPUDeviceLostInfo) => void>();
  readonly #isKept: boolean;
  #info: GPUDeviceLostInfo | undefined;
  #users = 0;

  constructor(device: GPUDevice, isKept: boolean) {
    this.device = device;
    this.#isKept = isKept;
    void device.lost.then((info) => {
      this.isLost = true;
      this.#info = info;
      if (this.isClosed) return;
      for (const tell of this.#listeners) tell(info);
      this.#listeners.clear();
    });
  }

  /** A share in the device; the last one to be given back calls `onUnused`. */
  lease(onUnused: () => void): DeviceLease {
    let tell: (info: GPUDeviceLostInfo) => void = () => undefined;
    const lost = new Promise<GPUDeviceLostInfo>((resolve) => (tell = resolve));
    if (this.#info) tell(this.#info);
    this.#users++;
    this.#listeners.add(tell);
    let released = false;
    const isLost = (): boolean => this.isLost;
    return {
      device: this.device,
      context: this.device,
      limits: this.device.limits,
      memory: MemoryLedger.of(this.device),
      lost,
      get isLost() {
        return isLost();
      },
      release: () => {
        if (released) return;
        released = true;
        this.#listeners.delete(tell);
        if (--this.#users === 0) onUnused();
      },
    };
  }

  close(): void {
    this.isClosed = true;
    if (!this.#isKept) this.device.destroy();
  }
}

/**
 * One GPU device for all elements of a page: requested when the first of them needs it, destroyed when the last has
 * let go, requested anew after a loss.
 */
export class SharedDevice {
  readonly #request: () => GPUDevice | Promise<GPUDevice>;
  readonly #keepDevice: boolean;
  #session: Promise<DeviceSession> | null = null;

  /**
   * @param request where devices come from; asked again after a loss.
   * @param options.keepDevice leaves the device alone when the last user has let go: for a page that has its own.
   */
  constructor(
    request: () => GPUDevice | Promise<GPUDevice> = requestGpuDevice,
    options: { readonly keepDevice?: boolean } = {},
  ) {
    this.#request = request;
    this.#keepDevice = options.keepDevice ?? false;
  }

  /** A share in the device. Rejects with GaussianSplatError `unsupported/*` where there is none to be had. */
  async acquire(): Promise<DeviceLease> {
    const opening = (this.#session ??= this.#open());
    let session: DeviceSession;
    try {
      session = await opening;
    } catch (error) {
      if (error instanceof GaussianSplatError) throw error;
      throw await why(({ noDevice }) => noDevice(error));
    }
    // Its last user may have closed it while we waited.
    if (session.isClosed) return this.acquire();
    return session.lease(() => {
      this.#forget(opening);
      session.close();
    });
  }

  #open(): Promise<DeviceSession> {
    const opening = this.#start();
    const forget = (): void => this.#forget(opening);
    opening.then((session) => session.device.lost.then(forget), forget);
    return opening;
  }

  async #start(): Promise<DeviceSession> {
    return new DeviceSession(await this.#answer(), this.#keepDevice);
  }

  /** A browser whose GPU process hangs never answers. */
  async #answer(): Promise<GPUDevice> {
    let isLate = false;
    let timer: ReturnType<typeof setTimeout> | undefined;
    const asked = Promise.resolve(this.#request());
    const silence = new Promise<never>((_, reject) => {
      timer = setTimeout(() => {
        isLate = true;
        reject(new Error(`no answer within ${ANSWER_MS / 1000} s`));
      }, ANSWER_MS);
    });
    asked.then(
      (device) => isLate && !this.#keepDevice && device.destroy(),
      () => undefined,
    );
    return Promise.race([asked, silence]).finally(() => clearTimeout(timer));
  }

  #forget(opening: Promise<DeviceSession>): void {
    if (this.#session === opening) this.#session = null;
  }
}
