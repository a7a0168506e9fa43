import WebSocket from 'ws';
import { encodeUpdate } from '../../../../packages/formats/dist/updates/index.js';

const servers = new Map();

/**
 * Starts a WebSocket server with a training whose step rises by one every `everyMs`. It sends the newest state after each
 * text of the page, as docs/guide/changing-scenes.md describes, or with `pushes` each state at once. `shown` of a state is
 * red before the step `greenAt`, then green. Returns its address.
 */
export async function startTraining({ count, everyMs, greenAt, pushes = false }) {
  const server = new WebSocket.Server({ port: 0, host: '127.0.0.1' });
  await new Promise((resolve) => server.once('listening', resolve));
  const log = { requests: [], sent: [], step: 0, closed: [] };
  const url = `ws://127.0.0.1:${server.address().port}/`;
  const send = (socket) => {
    log.sent.push(log.step);
    socket.send(Buffer.from(encodeUpdate(stateOf(log.step, count, log.step >= greenAt))));
  };
  const timer = setInterval(() => {
    log.step++;
    if (pushes) for (const socket of server.clients) send(socket);
  }, everyMs);
  server.on('connection', (socket) => {
    socket.on('message', (text) => {
      log.requests.push(String(text));
      if (!pushes) send(socket);
    });
    socket.on('close', (code) => log.closed.push(code));
  });
  servers.set(url, { server, timer, log });
  return url;
}

/** Returns the requests of the pages, the steps that were sent, the current step, and the codes of closed connections. */
export const trainingLog = (url) => servers.get(url).log;

/** Ends a server. `code` closes its connections; without one they break. */
export function endTraining({ url, code }) {
  const { server, timer } = servers.get(url);
  clearInterval(timer);
  for (const socket of server.clients)
    if (code) socket.close(code);
    else socket.terminate();
  server.close();
}

/** A ball of opaque splats, red or green. */
function stateOf(step, count, isGreen) {
  const fill = (stride, value) =>
    Float32Array.from({ length: stride * count }, (_, at) => value(Math.floor(at / stride), at % stride));
  return {
    step,
    positions: fill(3, (i, k) => 0.3 * Math.sin(i * (k + 1) * 1.7)),
    scales: fill(3, () => 0.1),
    rotations: fill(4, (_, k) => (k === 0 ? 1 : 0)),
    opacities: fill(1, () => 0.95),
    colors: fill(3, (_, k) => (k === (isGreen ? 1 : 0) ? 1 : 0)),
  };
}
