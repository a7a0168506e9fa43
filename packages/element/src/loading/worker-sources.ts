import { spawnText } from './spawn-worker.js';
import { BOOTSTRAP, type CodeAnswer, type CodeQuestion } from './worker-bootstrap.js';

/**
 * Ways to start the worker of the package, tried in order. The first starts it from text: the build converts the
 * worker's code and each reader to strings in separate modules. Bundlers differ in handling workers, but all split and
 * serve lazily imported modules. The second is for a Content-Security-Policy that excludes `blob:`. It starts a file
 * with all readers, which only bundlers that recognize this expression emit.
 */
export const WORKER_SOURCES: readonly (() => Worker)[] = [
  spawnOfText,
  (): Worker => new Worker(new URL('./scene-worker.bundle.js', import.meta.url), { type: 'module' }),
];

function spawnOfText(): Worker {
  const worker = spawnText(BOOTSTRAP);
  const { port1, port2 } = new MessageChannel();
  const sent = new Set<string>();
  port1.onmessage = ({ data }: MessageEvent<CodeQuestion>) => void answer(data, port1, sent);
  worker.postMessage(null, [port2]);
  return worker;
}

/** Sends the texts of a chunk and of its dependencies that the worker lacks; the text of the chunk itself is last. */
async function answer({ id, chunk }: CodeQuestion, port: MessagePort, sent: Set<string>): Promise<void> {
  try {
    const { CHUNKS } = await import('./worker-code.js');
    const names = [...CHUNKS[chunk].needs, chunk].filter((name) => !sent.has(name));
    const modules = await Promise.all(names.map((name) => CHUNKS[name].load()));
    // Marked before the texts are posted, because answers to other requests may depend on these texts.
    for (const name of names) sent.add(name);
    port.postMessage({ id, texts: modules.map(({ default: text }) => text) } satisfies CodeAnswer);
  } catch (error) {
    port.postMessage({ id, failure: (error as Error).message } satisfies CodeAnswer);
  }
}
