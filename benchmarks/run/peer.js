/** Another renderer as a subject (see measure.js): it runs in a frame of its own, where its page has a function `openSubject`. */

const TITLES = { playcanvas: 'PlayCanvas', spark: 'Spark' };
export const PEERS = Object.keys(TITLES);

/**
 * Opens a peer on a scene.
 * @param ply {Blob} the scene as an INRIA PLY file.
 */
export async function openPeer({ peer, parity, antialiased, width, height }, ply) {
  if (!PEERS.includes(peer)) throw new RangeError(`peer: expected ${PEERS.join(' or ')}, found "${peer}"`);
  const frame = document.createElement('iframe');
  frame.className = 'peer';
  frame.width = width;
  frame.height = height;
  frame.src = new URL(`peers/${peer}.html`, location.href).href;
  document.body.append(frame);
  try {
    await new Promise((resolve, reject) => {
      frame.onload = resolve;
      frame.onerror = () => reject(new Error(`${frame.src} did not load`));
    });
    const { openSubject } = frame.contentWindow;
    if (!openSubject) throw new Error(`${frame.src}: its script did not run; build the demo first (npm run build)`);
    const subject = await openSubject({ ply, parity, antialiased, width, height });
    return Object.assign(subject, { close: () => {}, dispose: () => frame.remove() });
  } catch (error) {
    frame.remove();
    throw error;
  }
}

/** The name of a peer as its makers write it, with its version. */
export const peerTitle = (peer, versions) => `${TITLES[peer] ?? peer} ${versions[peer] ?? ''}`.trim();
