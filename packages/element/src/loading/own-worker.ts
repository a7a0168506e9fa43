import { spawnText } from './spawn-worker.js';
import { BOOTSTRAP, type CodeAnswer, type CodeQuestion } from './worker-bootstrap.js';

/**
 * How the package starts its worker, in the order in which it is tried. First as text: the build has made the worker's code and each reader a
 * string in a module of its own. Bundlers treat workers each in their own way; such modules they split and serve as any that is imported lazily.
 * Where a Content-Security-Policy has no `blob:`, it is the file that those bundlers emit which know this expression; it has all readers in it.
 */
export const OWN_WORKERS: readonly (() => Worker)[] = [
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

/** Sends the texts that a chunk of the worker's code needs and that have not been sent, its own last. */
async function answer({ id, chunk }: CodeQuestion, port: MessagePort, sent: Set<string>): Promise<void> {
  try {
    const { CHUNKS } = await import('./worker-code.js');
    const names = [...CHUNKS[chunk].needs, chunk].filter((name) => !sent.has(name));
    const modules = await Promise.all(names.map((name) => CHUNKS[name].load()));
    // Others may have been asked for meanwhile: they build on what is sent here, and before them.
    for (const name of names) sent.add(name);
    port.postMessage({ id, texts: modules.map(({ default: text }) => text) } satisfies CodeAnswer);
  } catch (error) {
    port.postMessage({ id, failure: (error as Error).message } satisfies CodeAnswer);
  }
}
