/** Another renderer, or another build of this one, as a subject (see measure.js). It runs in an iframe whose page has a function `openSubject`. */

export const PEERS = ['playcanvas', 'spark', 'ours'];

/**
 * Opens a peer on a scene.
 * @param configuration {object} `build` is the URL of the folder of bench pages that has the peer's page; '' for this one.
 * @param scene {BenchScene} the scene: other renderers read it as a PLY file, our builds load it themselves.
 */
export async function openPeer(configuration, scene) {
  const { peer, build, width, height } = configuration;
  if (!PEERS.includes(peer)) throw new RangeError(`peer: expected ${PEERS.join(' or ')}, found "${peer}"`);
  const frame = document.createElement('iframe');
  frame.className = 'peer';
  frame.width = width;
  frame.height = height;
  frame.src = new URL(`peers/${peer}.html`, new URL(build, location.href)).href;
  document.body.append(frame);
  try {
    await new Promise((resolve, reject) => {
      frame.onload = resolve;
      frame.onerror = () => reject(new Error(`${frame.src} did not load`));
    });
    const { openSubject } = frame.contentWindow;
    if (!openSubject) throw new Error(`${frame.src}: its script did not run; build the demo first (npm run build)`);
    const source = peer === 'ours' ? { scene: new URL(configuration.scene, location.href).href } : { ply: scene.ply() };
    const subject = await openSubject({ ...configuration, ...source, antialiased: scene.antialiased });
    return Object.assign(subject, { close: () => {}, dispose: () => frame.remove() });
  } catch (error) {
    frame.remove();
    throw error;
  }
}
