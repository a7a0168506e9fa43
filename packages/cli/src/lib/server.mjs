/**
 * Static file server for the command `page`, the demo and the tests. It supports byte ranges, does not allow caching, and
 * serves no file outside its folders, also not by links within them.
 */
import { createReadStream, realpathSync, statSync } from 'node:fs';
import { createServer } from 'node:http';
import { extname, join, sep } from 'node:path';
import { pipeline } from 'node:stream';

/** Content types by extension. */
export const TYPES = {
  '.html': 'text/html; charset=utf-8',
  '.css': 'text/css; charset=utf-8',
  '.js': 'text/javascript; charset=utf-8',
  '.mjs': 'text/javascript; charset=utf-8',
  '.json': 'application/json',
  '.map': 'application/json',
  '.svg': 'image/svg+xml',
  '.png': 'image/png',
  '.jpg': 'image/jpeg',
  '.webp': 'image/webp',
  '.wasm': 'application/wasm',
  '.md': 'text/markdown; charset=utf-8',
};

/**
 * Serves folders.
 * @param mounts Folder of each URL prefix; the longest prefix that matches applies.
 * @returns A promise of the listening server, whose `address()` contains the port.
 */
export function serve(mounts, { port = 0, host = '127.0.0.1', headers = {} } = {}) {
  const prefixes = Object.keys(mounts).sort((a, b) => b.length - a.length);
  const server = createServer((request, response) => {
    let path;
    try {
      path = decodeURIComponent(new URL(request.url, 'http://localhost').pathname);
    } catch {
      return send(response, 400, 'Bad request');
    }
    const prefix = prefixes.find((p) => path.startsWith(p));
    const found = prefix && findFile(mounts[prefix], path.slice(prefix.length));
    if (!found) return send(response, 404, `Not found: ${path}`);
    sendFile(request, response, found, headers);
  });
  return new Promise((resolve, reject) => {
    server.once('error', reject);
    server.listen(port, host, () => resolve(server));
  });
}

function findFile(folder, path) {
  try {
    const root = realpathSync(folder);
    const file = realpathSync(join(folder, path));
    if (file !== root && !file.startsWith(root + sep) && root !== sep) return undefined;
    const status = statSync(file);
    if (status.isDirectory()) return findFile(folder, join(path, 'index.html'));
    return { path: file, size: status.size };
  } catch {
    return undefined;
  }
}

function send(response, status, text) {
  response.writeHead(status, { 'content-type': 'text/plain; charset=utf-8' }).end(text);
}

function sendFile(request, response, { path, size }, extraHeaders) {
  const headers = {
    'content-type': TYPES[extname(path)] ?? 'application/octet-stream',
    'accept-ranges': 'bytes',
    'cache-control': 'no-cache',
    ...extraHeaders,
  };
  const range = /^bytes=(\d+)-(\d*)$/.exec(request.headers.range ?? '');
  const start = range ? Number(range[1]) : 0;
  const end = range && range[2] !== '' ? Math.min(Number(range[2]), size - 1) : size - 1;
  if (range && start > end) {
    response.writeHead(416, { 'content-range': `bytes */${size}` }).end();
    return;
  }
  if (range) headers['content-range'] = `bytes ${start}-${end}/${size}`;
  response.writeHead(range ? 206 : 200, { ...headers, 'content-length': end - start + 1 });
  if (request.method === 'HEAD' || size === 0) response.end();
  // `pipeline` closes the file if the request is aborted.
  else pipeline(createReadStream(path, { start, end }), response, () => {});
}
