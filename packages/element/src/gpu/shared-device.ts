import { GaussianSplatError } from '@gaussian-splat/core';
import { MemoryLedger } from '@gaussian-splat/renderer';
import type { DeviceOwner } from './backend.js';
import { requestGpuDevice, why } from './request-device.js';

/** Time limit of a request for a device, ms. */
const ANSWER_MS = 20_000;

/** A lease of the page's GPU device. */
export interface DeviceLease extends DeviceOwner {
  readonly device: GPUDevice;
  /**
   * Releases the lease. The release of the last lease destroys the device, unless the page keeps it. Further calls have
   * no effect.
   */
  release(): void;
}

/** One device, and its leases. */
class DeviceSession {
  isLost = false;
  isClosed = false;
  readonly device: GPUDevice;
  /**
   * Listeners for the loss of the device, one for each lease. A promise that all leases share would keep the memory of
   * released ones alive.
   */
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
      for (const notify of this.#listeners) notify(info);
      this.#listeners.clear();
    });
  }

  /** Returns a new lease of the device. The release of the last lease calls `onUnused`. */
  lease(onUnused: () => void): DeviceLease {
    let notify: (info: GPUDeviceLostInfo) => void = () => undefined;
    const lost = new Promise<GPUDeviceLostInfo>((resolve) => (notify = resolve));
    if (this.#info) notify(this.#info);
    this.#users++;
    this.#listeners.add(notify);
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
        this.#listeners.delete(notify);
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
 * One GPU device for all elements of a page. It is requested when the first element needs it, destroyed when the last
 * element has released it, and requested again after a loss.
 */
export class SharedDevice {
  readonly #request: () => GPUDevice | Promise<GPUDevice>;
  readonly #keepDevice: boolean;
  #session: Promise<DeviceSession> | null = null;

  /**
   * @param request Returns a device; called again after a loss. Default: requests a device of the browser.
   * @param options.keepDevice Whether the device is kept when its last user has released it, because it belongs to the
   * page.
   */
  constructor(
    request: () => GPUDevice | Promise<GPUDevice> = requestGpuDevice,
    options: { readonly keepDevice?: boolean } = {},
  ) {
    this.#request = request;
    this.#keepDevice = options.keepDevice ?? false;
  }

  /** Returns a lease of the device. Rejects with GaussianSplatError `unsupported/*` if none is available. */
  async acquire(): Promise<DeviceLease> {
    const opening = (this.#session ??= this.#open());
    let session: DeviceSession;
    try {
      session = await opening;
    } catch (error) {
      if (error instanceof GaussianSplatError) throw error;
      throw await why(({ noDevice }) => noDevice(error));
    }
    // The last user may have closed the session during the wait.
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

  /**
   * Requests a device with a time limit, because a browser whose GPU process hangs never responds. A device that
   * arrives later is destroyed.
   */
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

/**
 * Opens something that then owns a lease of the device. The lease is released if that fails.
 * @param open Receives the lease while it may still be awaited.
 */
export async function withLease<T>(
  device: SharedDevice,
  open: (lease: Promise<DeviceLease>) => Promise<T>,
): Promise<T> {
  const acquiring = device.acquire();
  // `open` may fail, or load code, before it awaits the lease.
  acquiring.catch(() => undefined);
  try {
    return await open(acquiring);
  } catch (error) {
    acquiring.then(
      (lease) => lease.release(),
      () => undefined,
    );
    throw error;
  }
}
