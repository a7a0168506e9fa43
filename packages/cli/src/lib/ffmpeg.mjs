/** Videos by ffmpeg, a program that is installed apart. */
import { spawn, spawnSync } from 'node:child_process';
import { renameSync, rmSync } from 'node:fs';
import { extname } from 'node:path';
import { UsageError } from './command.mjs';

/** Arguments of ffmpeg by the extension of the file. */
const FORMATS = {
  '.mp4': { codec: ['-c:v', 'libx264', '-preset', 'slow', '-movflags', '+faststart'], needsEven: true },
  '.webm': { codec: ['-c:v', 'libvpx-vp9', '-b:v', '0', '-row-mt', '1', '-auto-alt-ref', '0'], hasAlpha: true },
};
/** Constant quality: 0 is the best of both codecs. */
const QUALITY = ['-crf', '16'];
/** Without it, players would show the colors of another matrix. */
const COLORS = ['-colorspace', 'bt709', '-color_primaries', 'bt709', '-color_trc', 'bt709', '-color_range', 'tv'];

/** Whether a file is a video, by its name. */
export const isVideo = (path) => extname(path).toLowerCase() in FORMATS;

/** Whether a file of this name keeps the alpha of its frames. */
export const keepsAlpha = (path) => FORMATS[extname(path).toLowerCase()].hasAlpha === true;

/** @throws UsageError without ffmpeg, and for a size that the format cannot have */
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
 * A video that frames are written to, one after another. Its file appears once it is whole.
 * @param size.isOpaque all alpha is 1
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
      rmSync(part, { force: true });
      reject(new Error(`ffmpeg ended with ${code}: ${complaint.trim()}`));
    });
  });
  // The next write reports it.
  ended.catch(() => undefined);
  program.stdin.on('error', () => undefined);
  return {
    /** @param bytes RGBA with straight alpha */
    async write(bytes) {
      if (program.stdin.write(bytes)) return;
      await Promise.race([new Promise((resolve) => program.stdin.once('drain', resolve)), ended]);
    },
    async finish() {
      program.stdin.end();
      await ended;
      renameSync(part, path);
    },
    abort() {
      program.kill();
    },
  };
}
