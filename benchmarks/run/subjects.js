/** Opens the renderer of a configuration: ours or a peer. */
import { OwnRenderer } from './own-renderer.js';
import { openPeer } from './peer.js';

/**
 * Subjects of one scene. Ours are created again for each visit, so that none holds memory while another is measured;
 * peers take seconds to open, so they stay, idle, until `dispose`.
 */
export class Subjects {
  #device;
  #scene;
  #peers = new Map();

  constructor(device, scene) {
    this.#device = device;
    this.#scene = scene;
  }

  async open(configuration) {
    if (configuration.peer) return this.#openPeer(configuration);
    return new OwnRenderer(this.#device, await this.#scene.upload(configuration.pack), configuration);
  }

  async #openPeer(configuration) {
    const { peer, build, parity, width, height, resolutionScale, options, pack } = configuration;
    const key = JSON.stringify([peer, build, parity, width, height, resolutionScale, options, pack]);
    if (!this.#peers.has(key)) this.#peers.set(key, await openPeer(configuration, this.#scene));
    return this.#peers.get(key);
  }

  dispose() {
    for (const peer of this.#peers.values()) peer.dispose();
    this.#peers.clear();
  }
}
