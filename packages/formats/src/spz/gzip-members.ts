/** Inflates gzip files of several members, as concatenated files are. Loaded only for files with bytes after a member. */
import { Gunzip } from 'fflate';

/** Number of compressed bytes that are inflated in one step. They may inflate to 17 MB. */
const FEED_BYTES = 16_384;

/**
 * Returns a reader of the content of all members of a gzip file. Bytes that are no member, such as padding after the
 * last one, end the content.
 * @param skipped Number of inflated bytes at the beginning that are left out.
 */
export function readMembers(file: Uint8Array, skipped: number): ReadableStreamDefaultReader<Uint8Array> {
  let found: Uint8Array[] = [];
  const members = new Gunzip((chunk) => found.push(chunk));
  let [at, rest] = [0, skipped];
  const stream = new ReadableStream<Uint8Array>({
    pull(controller) {
      let hasContent = false;
      while (!hasContent && at < file.length) {
        found = [];
        try {
          members.push(file.subarray(at, at + FEED_BYTES));
          at += FEED_BYTES;
        } catch {
          at = file.length;
        }
        for (const chunk of found) {
          const own = chunk.subarray(Math.min(rest, chunk.length));
          rest -= chunk.length - own.length;
          hasContent ||= own.length > 0;
          if (own.length > 0) controller.enqueue(own);
        }
      }
      if (!hasContent) controller.close();
    },
  });
  return stream.getReader();
}
