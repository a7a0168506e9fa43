/** Encoder of videos by the program ffmpeg, which must be installed separately. */
import { spawn, spawnSync } from 'node:child_process';
import { renameSync, rmSync } from 'node:fs';
import { extname } from 'node:path';
import { CommandError, UsageError } from './command.mjs';

/** Arguments of ffmpeg by the extension of the file. */
const FORMATS = {
  '.mp4': { codec: ['-c:v', 'libx264', '-preset', 'slow', '-movflags', '+faststart'], needsEven: true },
  '.webm': { codec: ['-c:v', 'libvpx-vp9', '-b:v', '0', '-row-mt', '1', '-auto-alt-ref', '0'], hasAlpha: true },
};
/** Constant quality (CRF) of both codecs; 0 is the best quality. */
const QUALITY = ['-crf', '16'];
/** Declaration of the color space. Without it, players would assume another matrix. */
const COLORS = ['-colorspace', 'bt709', '-color_primaries', 'bt709', '-color_trc', 'bt709', '-color_range', 'tv'];

/** Whether a path has the extension of a video. */
export const isVideo = (path) => extname(path).toLowerCase() in FORMATS;

/** Whether a video with the extension of a path can contain alpha. */
export const keepsAlpha = (path) => FORMATS[extname(path).toLowerCase()].hasAlpha === true;

/** Checks that ffmpeg is installed, and that the format supports the size in pixels. @throws UsageError */
export function checkVideo(path, width, height) {
  const extension = extname(path).toLowerCase();
  if (FORMATS[extension].needsEven && (width % 2 !== 0 || height % 2 !== 0))
    throw new UsageError(`--out: expected even sides for ${extension}, found ${width}x${height}`);
  if (spawnSync('ffmpeg', ['-version']).error)
    throw new UsageError(
      `--out: expected the program ffmpeg for ${extension}, found none on the PATH. Install it, or name a folder for PNG files`,
    );
}

/**
 * Opens a video for frames that are written in sequence. The file exists only after `finish` resolves.
 * @param options.isOpaque Whether alpha is 1 in all pixels.
 */
export function openVideo(path, { width, height, frameRate, isOpaque }) {
  const { codec } = FORMATS[extname(path).toLowerCase()];
  const part = path.replace(/(\.\w+)$/, `.${process.pid}.part$1`);
  const pixels = isOpaque || !keepsAlpha(path) ? 'yuv420p' : 'yuva420p';
  const input = ['-f', 'rawvideo', '-pix_fmt', 'rgba', '-s', `${width}x${height}`, '-r', `${frameRate}`, '-i', '-'];
  const convert = ['-vf', 'scale=out_color_matrix=bt709:out_range=tv', '-pix_fmt', pixels];
  const args = ['-v', 'error', '-y', ...input, ...convert, ...codec, ...QUALITY, ...COLORS, part];
  const program = spawn('ffmpeg', args, { stdio: ['pipe', 'ignore', 'pipe'] });
  let complaint = '';
  program.stderr.on('data', (text) => (complaint += text));
  const ended = new Promise((resolve, reject) => {
    program.once('error', reject);
    program.once('close', (code) => {
      if (code === 0) return resolve();
      reject(new CommandError(`ffmpeg ended with ${code}: ${complaint.trim()}`));
    });
  });
  // This handler prevents an unhandled rejection. `write` and `finish` report the error.
  ended.catch(() => undefined);
  program.stdin.on('error', () => undefined);
  const abort = async () => {
    program.kill();
    await ended.catch(() => undefined);
    rmSync(part, { force: true });
  };
  for (const signal of ['SIGINT', 'SIGTERM']) process.once(signal, () => abort().finally(() => process.exit(1)));
  return {
    /** Writes a frame. @param bytes [height, width, 4] RGBA with straight alpha. */
    async write(bytes) {
      if (program.stdin.write(bytes)) return;
      await Promise.race([new Promise((resolve) => program.stdin.once('drain', resolve)), ended]);
    },
    async finish() {
      program.stdin.end();
      await ended;
      renameSync(part, path);
    },
    /** Ends the program and removes the partial file. */
    abort,
  };
}
