/** Servers as the web has them: slow, broken, lying, strict, and elsewhere. */
import { createReadStream, existsSync, readFileSync, statSync } from 'node:fs';
import { createServer } from 'node:http';
import { extname, join, normalize } from 'node:path';
import { PassThrough, Readable } from 'node:stream';
import { setTimeout as delay } from 'node:timers/promises';
import { fileURLToPath } from 'node:url';
import { gzipSync } from 'node:zlib';
import { DEVELOPMENT_APP, developmentScript, frameworkScript, plainApp } from './apps.mjs';

const root = fileURLToPath(new URL('../../../../', import.meta.url));
const fixtures = fileURLToPath(new URL('../fixtures/', import.meta.url));
const generators = join(root, 'tests/fixtures/generators');
const attackCases = join(root, '../shared/cases/attack');
const sharedData = join(root, '../shared/data');

/** Answers under /net/; everything else is left to the test runner's own server, unless a test has it be lost. */
export function hostileServer(otherOrigin) {
  return async (context, next) => {
    const [, net, kind, ...rest] = context.path.split('/');
    if (lost.some((end) => context.path.endsWith(end))) {
      // The runner would have browsers keep the answer for a year.
      context.respond = false;
      return void context.res.writeHead(404, { 'Cache-Control': 'no-store' }).end();
    }
    const once = refused.folder && context.path.startsWith(refused.folder) && HASHED.test(context.path);
    if (once) {
      const name = context.path.slice(refused.folder.length);
      refused.served[name] = (refused.served[name] ?? -1) + 1;
      if (refused.served[name] === 0) {
        context.respond = false;
        return void context.res.writeHead(404, { 'Cache-Control': 'no-store' }).end();
      }
    }
    if (held.file && net !== 'net' && context.path.endsWith(held.file)) await delay(held.ms);
    if (net !== 'net' || !(kind in ANSWERS)) return next();
    context.set('Cache-Control', 'no-store');
    return ANSWERS[kind](context, rest.join('/'), otherOrigin);
  };
}

/** Frames of the sequence that were fetched since `/net/sequence/asked` was. */
const askedFrames = [];
/** Ends of paths that are not found. */
let lost = [];
/** Chunks of a build in this folder are not found when they are asked for first; and how often each has been served. */
const refused = { folder: '', served: {} };
/** Names of chunks that few pages need carry a hash. */
const HASHED = /-[\w-]{8}\.js$/;
/** The end of a path whose answer waits. */
let held = { file: '', ms: 0 };

/** Gates that files wait for, by name. */
const gates = new Map();

function gateOf(name) {
  if (!gates.has(name)) {
    let open;
    const gate = {
      isOpen: false,
      opened: new Promise((resolve) => (open = resolve)),
      open: () => open((gate.isOpen = true)),
    };
    gates.set(name, gate);
  }
  return gates.get(name);
}

/** Bytes of each piece that passes a closed gate. */
const DROP = 16_384;

/** Files that tests have put on the server, and their requests, by folder. */
const kept = new Map();
const stuck = new Map();

/** Bytes a second of the link behind `/net/metered/`: 20 Mbit. */
const METERED_RATE = 2.5e6;
/** Links by name: bytes that have passed, and the time in ms from which the link is free. */
const links = new Map();

/** Sends bytes through a link, one piece after the other for all requests. */
async function* throughLink(link, bytes) {
  for (let at = 0; at < bytes.length; at += 16_384) {
    const piece = bytes.subarray(at, at + 16_384);
    const now = performance.now();
    link.freeAt = Math.max(now, link.freeAt) + (1000 * piece.length) / METERED_RATE;
    await delay(link.freeAt - now);
    link.sent += piece.length;
    yield piece;
  }
}

const ANSWERS = {
  status(context, code) {
    context.status = Number(code);
    context.body = 'no';
  },

  redirect(context) {
    context.redirect(context.query.to);
  },

  /** From now on these files, by the ends of their paths with commas between them, are not found; nothing for none. */
  lose(context, ends) {
    lost = ends ? ends.split(',').map((end) => `/${end}`) : [];
    context.status = 204;
  },

  /** From now on each chunk of a folder is not found once. */
  'refuse-once'(context, folder) {
    Object.assign(refused, { folder: `/${folder}`, served: {} });
    context.status = 204;
  },

  refused(context) {
    context.body = JSON.stringify(refused.served);
  },

  /** From now on a file, by the end of its path, comes `ms` later. */
  hold(context, file) {
    held = { file, ms: Number(context.query.ms) };
    context.status = 204;
  },

  /** A PLY of `n` splats of degree 3, 248 bytes each, in pieces of 4 MB, the second half in drops until a gate opens, if one is named: a cube of noise, some of it of no use. */
  'large-ply'(context) {
    const { n = 200_000, gate } = context.query;
    const { header, block } = largePly(Number(n));
    const size = 248 * Number(n);
    context.type = 'application/octet-stream';
    context.set('Content-Length', String(header.length + size));
    context.body = Readable.from(
      (async function* pieces() {
        yield header;
        for (let sent = 0; sent < size;) {
          const isHeld = gate && sent >= size / 2 && !gateOf(gate).isOpen;
          if (isHeld) await delay(100);
          const at = sent % block.length;
          const piece = block.subarray(at, at + Math.min(isHeld ? DROP : block.length, size - sent));
          yield piece;
          sent += piece.length;
        }
      })(),
    );
  },

  /** A PLY of 200,000 splats, with a part missing. */
  'short-ply'(context) {
    const { header, block } = largePly(200_000);
    context.body = Buffer.concat([header, ...Array.from({ length: 9 }, () => block)]);
  },

  /** Files that cost more than their size, if they are available. */
  attack(context, name) {
    const path = join(attackCases, normalize(`/${name}`));
    context.status = existsSync(path) ? 200 : 404;
    context.body = existsSync(path) ? readFileSync(path) : 'absent';
  },

  /** Never answered. */
  never(context) {
    context.respond = false;
  },

  html(context) {
    context.type = 'text/html';
    context.body = '<!doctype html><title>Log in</title><p>Please log in.</p>';
  },

  /** The file in eight pieces over `ms` milliseconds; with a `gate`, the last of them when that is opened. */
  slow(context, name) {
    const bytes = readFileSync(join(fixtures, name));
    const { ms, gate } = context.query;
    const pause = Number(ms ?? 800) / 8;
    context.set('Content-Length', String(bytes.length));
    context.body = Readable.from(
      (async function* pieces() {
        const size = Math.ceil(bytes.length / 8);
        for (let at = 0; at < bytes.length; at += size) {
          await delay(pause);
          if (gate && at + size >= bytes.length) await gateOf(gate).opened;
          yield bytes.subarray(at, at + size);
        }
      })(),
    );
  },

  /** Lets the last part of the files behind a gate through. */
  open(context, gate) {
    gateOf(gate).open();
    context.status = 204;
  },

  /** A red ball of `n` splats, 4,000 unless said, of a `size` that hardly covers it unless said, in twelve pieces over `ms` milliseconds. */
  ball(context) {
    const { n = 4_000, size } = context.query;
    const bytes = ball(Number(n), COLORS[0], size && Number(size));
    const pause = Number(context.query.ms ?? 0) / 12;
    context.set('Content-Length', String(bytes.length));
    context.body = Readable.from(
      (async function* pieces() {
        const size = 32 * Math.ceil(bytes.length / 32 / 12);
        for (let at = 0; at < bytes.length; at += size) {
          await delay(pause);
          yield bytes.subarray(at, at + size);
        }
      })(),
    );
  },

  /** A sequence: its manifest, and frames that are balls of other colors, each larger than the one before. `ms` delays frames, `lost` is one that is not there. */
  async sequence(context, name) {
    const { count = '12', fps = '10', ms = '0', lost } = context.query;
    if (name.endsWith('.json')) {
      const frames = Array.from({ length: Number(count) }, (_, k) => `${k}.splat?ms=${ms}&lost=${lost}`);
      context.body = JSON.stringify({ gaussianSplatSequence: 1, framesPerSecond: Number(fps), frames });
      return;
    }
    if (name === 'asked') return void (context.body = JSON.stringify(askedFrames.splice(0)));
    const frame = Number.parseInt(name, 10);
    askedFrames.push(frame);
    if (frame > 0) await delay(Number(ms));
    if (String(frame) === lost) return void (context.status = 404);
    context.body = ball(200 + 20 * (frame % 12), COLORS[frame % 3]);
  },

  /**
   * A clip of one ball that changes its color and place, with a splat that is in every other frame alone; groups of four frames, ten a second. `whole`: without byte ranges; `slow`: each answer is delayed by a number of milliseconds, and as late as `mbps` and at least `padded` bytes make it;
   * `gate`: data after the first group comes once it is opened; `lost`: a missing group; `replaced`: a gate that replaces the file by one of 12 frames more; `alternating`: from this group on, every answer says that it is of another version.
   */
  async clip(context) {
    const {
      frames = '12',
      whole,
      slow = '0',
      mbps = '0',
      padded = '0',
      lost,
      gate,
      replaced,
      alternating,
    } = context.query;
    const isReplaced = replaced !== undefined && gateOf(replaced).isOpen;
    if (replaced !== undefined) context.set('ETag', `"${isReplaced ? 2 : 1}"`);
    // A refusal, too. A 404 would be of the whole file: browsers give it to requests for other ranges.
    context.set('Cache-Control', 'no-store');
    const { bytes, starts } = await clipOf(Number(frames) + (isReplaced ? 12 : 0));
    const [, first, last] = /^bytes=(\d+)-(\d+)$/.exec(context.get('Range')) ?? [];
    if (slow !== '0' && Number(first) > 0) {
      const ownBytes = Math.max(Number(padded), Number(last) + 1 - Number(first));
      const transfer = mbps === '0' ? 0 : (8 * ownBytes) / (1000 * Number(mbps));
      await new Promise((resolve) => setTimeout(resolve, Number(slow) + transfer));
    }
    if (gate && Number(first) >= starts[1]) await gateOf(gate).opened;
    if (lost && Number(first) >= starts[Number(lost)] && !(Number(first) >= starts[Number(lost) + 1]))
      return void (context.status = 416);
    if (first === undefined || whole !== undefined) return void (context.body = Buffer.from(bytes));
    const end = Math.min(bytes.length, Number(last) + 1);
    const range = { 'Content-Range': `bytes ${first}-${end - 1}/${bytes.length}` };
    const part = Buffer.from(bytes.subarray(Number(first), end));
    if (alternating !== undefined) {
      const tag = Number(first) >= starts[Number(alternating)] ? ++answeredClips : 0;
      // The runner would have browsers keep the answer, and give parts of it to later requests.
      context.respond = false;
      return void context.res.writeHead(206, { ...range, ETag: `"${tag}"`, 'Cache-Control': 'no-store' }).end(part);
    }
    context.status = 206;
    context.set(range);
    context.body = part;
  },

  /** A sequence of two frames for requests with a token, red, or a signature, blue. Other requests fail. */
  signed(context, name) {
    const color = { 'token=a': COLORS[0], 'signed=b': COLORS[2] }[context.querystring];
    if (color === undefined) return void (context.status = 403);
    const manifest = { gaussianSplatSequence: 1, framesPerSecond: 10, frames: '{0}.splat', count: 2 };
    context.body = name.endsWith('.json') ? JSON.stringify(manifest) : ball(200, color);
  },

  /** Half of the file, then the connection breaks. */
  cut(context, name) {
    const bytes = readFileSync(join(fixtures, name));
    context.respond = false;
    const { res } = context;
    res.writeHead(200, { 'Content-Length': bytes.length, 'Cache-Control': 'no-store' });
    res.write(bytes.subarray(0, bytes.length / 2));
    setTimeout(() => res.destroy(), 100);
  },

  /** The first half of a generator, as if that were all; contracts beside it are not there. */
  head(context, name) {
    if (!name.endsWith('.onnx')) return void (context.status = 404);
    const bytes = readFileSync(join(generators, name));
    context.body = bytes.subarray(0, bytes.length / 2);
  },

  /** Half of a generator, then the connection breaks; nothing lies beside it. */
  'cut-model'(context, name) {
    if (!name.endsWith('.onnx')) return void (context.status = 404);
    answerRaw(context, name, (bytes) => [bytes.length, bytes.subarray(0, bytes.length / 2)]);
  },

  /** A generator that is said to be longer than it is. */
  'too-long'(context, name) {
    if (!name.endsWith('.onnx')) return void (context.status = 404);
    answerRaw(context, name, (bytes) => [bytes.length + 1000, bytes]);
  },

  /** A generator that is said to be shorter than it is. */
  'too-short'(context, name) {
    if (!name.endsWith('.onnx')) return void (context.status = 404);
    answerRaw(context, name, (bytes) => [Math.floor(bytes.length / 2), bytes]);
  },

  empty(context, name) {
    if (!name.endsWith('.onnx')) return void (context.status = 404);
    context.body = Buffer.alloc(0);
  },

  lfs(context, name) {
    if (!name.endsWith('.onnx')) return void (context.status = 404);
    context.body = `version https://git-lfs.github.com/spec/v1\noid sha256:${'0'.repeat(64)}\nsize 12345\n`;
  },

  /** A generator with a contract beside it: text that is no JSON, or one of another model. */
  sidecar(context, path) {
    const [kind, name] = path.split('/');
    if (name.endsWith('.onnx')) context.body = readFileSync(join(generators, name));
    else context.body = kind === 'json' ? '{"version": 1,' : readFileSync(join(generators, 'split.contract.json'));
  },

  /** A generator without any of the files that belong beside it. */
  renamed(context, name) {
    if (!name.endsWith('.onnx')) return void (context.status = 404);
    context.body = readFileSync(join(generators, name));
  },

  /** Files of onnxruntime-web as compressing servers send them: without their length. */
  compressed(context, path) {
    const bytes = readFileSync(join(root, 'node_modules', normalize(`/${path}`)));
    context.type = TYPES[extname(path)];
    context.set('Content-Encoding', 'gzip');
    context.body = gzipSync(bytes, { level: 1 });
  },

  /** Without Content-Length. */
  unsized(context, name) {
    context.body = createReadStream(join(fixtures, name));
  },

  /** The scenes beside the checkout, if there are any. */
  shared(context, name) {
    const path = join(sharedData, normalize(`/${name}`));
    context.status = existsSync(path) && statSync(path).isFile() ? 200 : 404;
    context.body = context.status === 200 ? createReadStream(path) : 'absent';
  },

  /** The same through a link of 20 Mbit/s that a test names: `/net/metered/LINK/PATH`. `sent` returns the bytes that have gone through it. */
  metered(context, path) {
    const [name, ...rest] = path.split('/');
    const link = links.get(name) ?? links.set(name, { sent: 0, freeAt: 0 }).get(name);
    if (rest.join() === 'sent') return void (context.body = String(link.sent));
    const file = join(sharedData, normalize(`/${rest.join('/')}`));
    context.status = existsSync(file) && statSync(file).isFile() ? 200 : 404;
    if (context.status !== 200) return void (context.body = 'absent');
    context.set('Content-Length', String(statSync(file).size));
    context.body = Readable.from(throughLink(link, readFileSync(file)));
  },

  /**
   * Files that a test has put there with PUT; DELETE takes one away. `log` returns the requested paths, in order. With a
   * `gate`, all requests after the first `passing` wait until it is opened. With `ranges`, ranges are answered, and listed as
   * `NAME FIRST-LAST`.
   */
  async kept(context, path) {
    const [folder, ...rest] = path.split('/');
    const { files, log } = kept.get(folder) ?? kept.set(folder, { files: new Map(), log: [] }).get(folder);
    const name = rest.join('/');
    if (context.method === 'PUT') {
      const pieces = [];
      for await (const piece of context.req) pieces.push(piece);
      files.set(name, Buffer.concat(pieces));
      context.status = 204;
    } else if (context.method === 'DELETE') {
      files.delete(name);
      context.status = 204;
    } else if (name === 'log') {
      context.body = JSON.stringify(log);
    } else {
      const { gate, passing, ranges } = context.query;
      const [, first, last] = (ranges !== undefined && /^bytes=(\d+)-(\d+)$/.exec(context.get('Range'))) || [];
      log.push(first === undefined ? name : `${name} ${first}-${last}`);
      // The browser's cache would hide requests from the log.
      context.set('Cache-Control', 'no-store');
      if (gate && log.length > Number(passing)) await gateOf(gate).opened;
      context.status = files.has(name) ? 200 : 404;
      context.body = files.get(name) ?? 'absent';
      if (first === undefined || !files.has(name)) return;
      const part = files.get(name).subarray(Number(first), Number(last) + 1);
      context.status = 206;
      context.set('Content-Range', `bytes ${first}-${Number(first) + part.length - 1}/${files.get(name).length}`);
      context.body = part;
    }
  },

  /** Sends a byte and nothing more. `NAME/open` returns the number of open connections for a name. */
  stuck(context, path) {
    const [name, ...rest] = path.split('/');
    if (rest.join() === 'open') return void (context.body = String(stuck.get(name) ?? 0));
    stuck.set(name, (stuck.get(name) ?? 0) + 1);
    context.res.on('close', () => stuck.set(name, stuck.get(name) - 1));
    const body = new PassThrough();
    body.write('a');
    context.body = body;
  },

  'soak-cycles'(context) {
    context.body = process.env.SOAK_CYCLES ?? '100';
  },

  'other-origin'(context, _rest, otherOrigin) {
    context.body = otherOrigin;
  },

  /** A page under a strict policy that allows no worker, no inline style and no inline script. */
  'strict-page'(context) {
    context.set(
      'Content-Security-Policy',
      "default-src 'none'; script-src 'self'; connect-src 'self'; style-src 'self'; worker-src 'none'",
    );
    context.type = 'text/html';
    context.body = `<!doctype html><title>Strict</title>
      <script src="/net/strict-script" type="module"></script>
      <gaussian-splat src="/tests/element/browser/fixtures/compass.ply" loading="eager" camera-controls></gaussian-splat>`;
  },

  /** The policy that the README recommends, Trusted Types included; `?generator` and `?wasm` add what WebAssembly needs; `?noworker` refuses workers. `?mesh=ADDRESS` shows a mesh, too. */
  'secure-page'(context) {
    const isGenerator = 'generator' in context.query;
    const wasm = isGenerator || 'wasm' in context.query ? " 'wasm-unsafe-eval'" : '';
    const { mesh } = context.query;
    const worker = 'noworker' in context.query ? "'none'" : "'self'";
    context.set(
      'Content-Security-Policy',
      `default-src 'none'; script-src 'self'${wasm}; worker-src ${worker}; connect-src 'self'; img-src 'self'; style-src 'self'; ` +
        "require-trusted-types-for 'script'; trusted-types lit-html gaussian-splat",
    );
    context.type = 'text/html';
    const src = isGenerator ? '/tests/fixtures/generators/packed.onnx' : '/tests/element/browser/fixtures/compass.ply';
    context.body = `<!doctype html><title>Secure</title>
      <script src="/net/strict-script" type="module"></script>
      <gaussian-splat src="${src}" loading="eager" camera-controls interaction-prompt-threshold="0" auto-rotate>${mesh ? `<splat-mesh src="${mesh}"></splat-mesh>` : ''}</gaussian-splat>`;
  },

  /** A page as the README has it: one script tag from another origin, with its integrity. */
  'cdn-page'(context, _rest, otherOrigin) {
    const hashes = JSON.parse(readFileSync(join(root, 'packages/element/cdn/integrity.json'), 'utf8'));
    const integrity = hashes['gaussian-splat.min.js'];
    context.type = 'text/html';
    context.body = `<!doctype html><title>CDN</title>
      <script type="module" src="${otherOrigin}/cdn/gaussian-splat.min.js" integrity="${integrity}" crossorigin></script>
      <gaussian-splat src="/tests/element/browser/fixtures/compass.ply" loading="eager"></gaussian-splat>
      <gaussian-splat src="/tests/fixtures/generators/packed.onnx" loading="eager"></gaussian-splat>
      <script type="module">
        await customElements.whenDefined('gaussian-splat');
        const elements = [...document.querySelectorAll('gaussian-splat')];
        const definedMs = performance.now();
        await Promise.all(elements.map(({ ready }) => ready));
        parent.postMessage({ definedMs, loaded: elements.map(({ loaded }) => loaded), errors: elements.map(({ error }) => error?.message),
          isolated: crossOriginIsolated, scripts: performance.getEntriesByType('resource').map(({ name }) => name).filter((name) => /[.](m?js|wasm)$/.test(name)) }, '*');
      </script>`;
  },

  /** The app of React in React's development build. */
  async 'react-development'(context, name) {
    context.type = name === 'app.js' ? 'text/javascript' : 'text/html';
    context.body = name === 'app.js' ? await developmentScript() : DEVELOPMENT_APP;
  },

  /** Modules of frameworks with their imports. */
  async 'framework-scenes'(context, name) {
    context.type = 'text/javascript';
    context.body = await frameworkScript(name);
  },

  /** The same app without any framework. */
  'plain-app'(context, _rest, otherOrigin) {
    context.type = 'text/html';
    context.body = plainApp(`${otherOrigin}/cdn/gaussian-splat.min.js`);
  },

  'strict-script'(context) {
    context.type = 'text/javascript';
    context.body = `const seen = { warnings: [], violations: [] };
      console.warn = (...words) => seen.warnings.push(words.join(' '));
      addEventListener('securitypolicyviolation', (event) => seen.violations.push(event.effectiveDirective));
      await import('/packages/element/cdn/gaussian-splat.min.js');
      const element = document.querySelector('gaussian-splat');
      await element.ready;
      await new Promise((resolve) => setTimeout(resolve, 200));
      const mesh = document.querySelector('splat-mesh');
      const workers = performance.getEntriesByType('resource').filter(({ name }) => name.endsWith('/scene-worker.js')).length;
      parent.postMessage({ ...seen, loaded: element.loaded, error: element.error?.message, workers, mesh: mesh && [mesh.loaded, mesh.error?.message ?? null],
        prompt: element.shadowRoot.querySelector('[part=interaction-prompt]') !== null }, '*');`;
  },
};

/** Answers behind the server's back: with a length of our own, and an end when we like. */
function answerRaw(context, name, make) {
  const [length, body] = make(readFileSync(join(generators, name)));
  context.respond = false;
  const { res } = context;
  res.writeHead(200, { 'Content-Length': length, 'Cache-Control': 'no-store' });
  res.write(body);
  setTimeout(() => res.destroy(), 100);
}

const TYPES = {
  '.html': 'text/html',
  '.js': 'text/javascript',
  '.mjs': 'text/javascript',
  '.wasm': 'application/wasm',
  '.ply': 'application/octet-stream',
};

/**
 * A server of another origin, as a CDN is: /cdn/ and /fixtures/ with permission to be read, /closed/ without. `asked` returns the requests until now.
 * @returns its origin.
 */
export async function startOtherOrigin() {
  const folders = { cdn: join(root, 'packages/element/cdn'), fixtures, closed: fixtures };
  const asked = [];
  const server = createServer((request, response) => {
    const [, folder, ...rest] = new URL(request.url, 'http://x').pathname.split('/');
    if (folder === 'asked')
      return response.writeHead(200, { 'Access-Control-Allow-Origin': '*' }).end(JSON.stringify(asked));
    asked.push(request.url);
    const path = join(folders[folder] ?? '', normalize(`/${rest.join('/')}`));
    if (!(folder in folders) || !existsSync(path)) return response.writeHead(404).end();
    const headers = { 'Content-Type': TYPES[extname(path)] ?? 'application/octet-stream' };
    if (folder !== 'closed') headers['Access-Control-Allow-Origin'] = '*';
    response.writeHead(200, headers);
    return createReadStream(path).pipe(response);
  });
  await new Promise((resolve) => server.listen(0, '127.0.0.1', resolve));
  // The test runner ends when its own work is done; this server must not keep it.
  server.unref();
  return `http://127.0.0.1:${server.address().port}`;
}

/** Red, green, blue. */
const COLORS = [
  [230, 30, 30],
  [30, 230, 30],
  [30, 30, 230],
];

/** A .splat file: splats in no order on a ball of radius 1. */
function ball(count, color, size = Math.max(0.05, 2 / Math.sqrt(count))) {
  const bytes = Buffer.alloc(32 * count);
  for (let i = 0; i < count; i++) {
    const height = 1 - (2 * (i + 0.5)) / count;
    const angle = 2.399963 * i;
    const ring = Math.sqrt(1 - height * height);
    // Steps of a number without common factor: any part of the file is spread over the ball.
    const at = 32 * ((i * 1_301) % count);
    [ring * Math.cos(angle), height, ring * Math.sin(angle), size, size, size].forEach((value, k) =>
      bytes.writeFloatLE(value, at + 4 * k),
    );
    bytes.set([...color, 220, 255, 128, 128, 128], at + 24);
  }
  return bytes;
}

const clips = new Map();
/** Number of answers to requests for a clip whose every answer is of another version. */
let answeredClips = 0;

/** The clip with a number of frames, and the first byte of each of its groups. */
async function clipOf(frameCount) {
  const made = clips.get(frameCount) ?? makeClip(frameCount);
  clips.set(frameCount, made);
  return made;
}

async function makeClip(frameCount) {
  const { codeClip, encodingsFor } = await import('@gaussian-splat/optimize');
  const { readScene, parseClip } = await import('@gaussian-splat/formats');
  const first = await readScene(ball(200, COLORS[0]), { name: 'ball.splat' });
  const frameOf = (frame) => {
    const color = COLORS[frame % 3].map((value) => (value / 255 - 0.5) / 0.28209479177387814);
    const count = 200 - (frame % 2);
    return {
      ...first,
      count,
      positions: first.positions.slice(0, 3 * count).map((value, i) => value + (i % 3 === 0 ? 0.02 * (frame % 12) : 0)),
      scales: first.scales.slice(0, 3 * count),
      rotations: first.rotations.slice(0, 4 * count),
      opacities: first.opacities.slice(0, count),
      sh: first.sh.slice(0, 3 * count).map((_, i) => color[i % 3]),
    };
  };
  const { bytes } = await codeClip({
    ...{ frameCount, framesPerSecond: 10, framesPerGroup: 4, minPsnr: 45 },
    openFrame: async (frame) => frameOf(frame),
    rounding: {
      encoding: encodingsFor('a.ply')[0],
      steps: { position: 1e-3, rotation: 1e-2, scale: 1e-2, opacity: 1e-2, color: 1e-2 },
    },
  });
  return { bytes, starts: parseClip(bytes, 'a.gsv').groups.map(({ parts }) => parts[0].start) };
}

/** A PLY's header, and rows that it repeats. */
function largePly(count) {
  const rest = Array.from({ length: 45 }, (_, i) => `f_rest_${i}`);
  const names =
    `x y z nx ny nz f_dc_0 f_dc_1 f_dc_2 ${rest.join(' ')} opacity scale_0 scale_1 scale_2 rot_0 rot_1 rot_2 rot_3`.split(
      ' ',
    );
  const properties = names.map((name) => `property float ${name}`).join('\n');
  const header = `ply\nformat binary_little_endian 1.0\nelement vertex ${count}\n${properties}\nend_header\n`;
  const rows = 16_911;
  const values = new Float32Array(names.length * rows);
  let seed = 1;
  const random = () => (seed = (Math.imul(seed, 1664525) + 1013904223) >>> 0) / 2 ** 31 - 1;
  for (let row = 0; row < rows; row++) {
    const at = names.length * row;
    for (let k = 0; k < names.length; k++) values[at + k] = random() * (k < 3 ? 2 : k >= 9 && k < 54 ? 0.1 : 1);
    for (let k = 55; k < 58; k++) values[at + k] -= 4;
    if (row % 1000 === 0) values[at] = NaN;
  }
  return { header: Buffer.from(header), block: Buffer.from(values.buffer) };
}
