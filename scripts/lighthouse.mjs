/**
 * `npm run lab -- lighthouse [--only REGEX] [--runs 3] [--network 4g|slow4g] [--slowdown 4] [--keep FOLDER]`: paints, layout shift and bytes of pages of the built site as Lighthouse of
 * npm simulates them, on an emulated phone. Files come over HTTP/2 with Brotli, as from a content delivery network. It needs the npm registry and `openssl`.
 */
import { execFile, execFileSync } from 'node:child_process';
import { existsSync, mkdirSync, mkdtempSync, readFileSync, rmSync, statSync } from 'node:fs';
import { createSecureServer } from 'node:http2';
import { tmpdir } from 'node:os';
import { extname, join, normalize } from 'node:path';
import { parseArgs, promisify } from 'node:util';
import { brotliCompressSync, constants } from 'node:zlib';
import { findChromium, SWIFTSHADER_FLAGS } from './lib/chromium.mjs';
import { root } from './lib/run.mjs';
import { TYPES } from '../packages/cli/src/lib/server.mjs';

/** The last major version that runs on Node 20. */
const LIGHTHOUSE = 'lighthouse@12.8.2';
/** Round trips in ms and kbit/s of Lighthouse's "slow 4G" and "dense 4G". */
const NETWORKS = { slow4g: [150, 1638.4], '4g': [40, 10240] };
const PAGES = ['/', '/gallery/', '/gallery/apartment/', '/examples/', '/docs/guide/start/', '/react/', '/vue/'];
const COMPRESSED = /^text\/|json|javascript|svg/;

const { values } = parseArgs({
  options: {
    only: { type: 'string', default: '' },
    runs: { type: 'string', default: '3' },
    network: { type: 'string', default: '4g' },
    // How much slower the phone is than this machine. Lighthouse calls 125 to 800 points a usual phone, and those of this machine are printed.
    slowdown: { type: 'string', default: '4' },
    keep: { type: 'string' },
  },
});
if (!Object.hasOwn(NETWORKS, values.network)) {
  console.error(`--network: expected ${Object.keys(NETWORKS).join(' or ')}, found "${values.network}"`);
  process.exit(2);
}
const folder = values.keep ?? mkdtempSync(join(tmpdir(), 'lighthouse-'));
mkdirSync(folder, { recursive: true });
const server = await serveCompressed(`${root}demo/dist`);
const origin = `https://localhost:${server.address().port}`;
const middle = (list) => list.sort((a, b) => a - b)[Math.floor(list.length / 2)];

console.log(
  `page, medians of ${values.runs} on ${values.network}: LCP ms, FCP ms, CLS (largest), kB, points of this machine, largest element`,
);
for (const path of PAGES.filter((each) => new RegExp(values.only).test(each))) {
  const audits = [];
  for (let run = 0; run < Number(values.runs); run++)
    await auditsOf(path, run).then(
      (each) => audits.push(each),
      (error) => console.error(`${path}: ${error.stderr || error.message}`),
    );
  if (audits.length === 0) {
    process.exitCode = 1;
    continue;
  }
  const figure = (name) => middle(audits.map((each) => each[name].numericValue));
  const shift = Math.max(...audits.map((each) => each['cumulative-layout-shift'].numericValue));
  const largest = audits[0]['largest-contentful-paint-element']?.details?.items[0]?.items[0]?.node.selector;
  const [lcp, fcp] = ['largest-contentful-paint', 'first-contentful-paint'].map((name) => figure(name).toFixed(0));
  console.log(
    `${path}: ${lcp}, ${fcp}, ${shift.toFixed(4)}, ${(figure('total-byte-weight') / 1000).toFixed(0)}, ${figure('points').toFixed(0)}, ${largest}`,
  );
}
server.close();
server.closeAllConnections?.();
if (values.keep === undefined) rmSync(folder, { recursive: true });
process.exit();

async function auditsOf(path, run) {
  const [rtt, rate] = NETWORKS[values.network];
  const out = join(folder, `${path.replaceAll('/', '-')}${run}.json`);
  const flags = [...SWIFTSHADER_FLAGS, '--headless=new', '--ignore-certificate-errors'].join(' ');
  const throttling = { rttMs: rtt, throughputKbps: rate, cpuSlowdownMultiplier: values.slowdown };
  await promisify(execFile)('npx', [
    ...['--yes', LIGHTHOUSE, origin + path, '--quiet', '--only-categories=performance', `--chrome-flags=${flags}`],
    ...['--output=json', `--output-path=${out}`],
    ...Object.entries(throttling).map(([name, value]) => `--throttling.${name}=${value}`),
  ], { env: { ...process.env, CHROME_PATH: findChromium() } }); // prettier-ignore
  const { audits, environment, runtimeError } = JSON.parse(readFileSync(out, 'utf8'));
  if (runtimeError) throw new Error(`${path}: ${runtimeError.message}`);
  return { ...audits, points: { numericValue: environment.benchmarkIndex } };
}

/** Serves a folder over HTTP/2 with a certificate of its own, texts with Brotli, and caches what it has compressed. */
async function serveCompressed(site) {
  const [key, cert] = ['key.pem', 'cert.pem'].map((name) => join(folder, name));
  execFileSync('openssl', [
    ...['req', '-x509', '-newkey', 'ec', '-pkeyopt', 'ec_paramgen_curve:prime256v1', '-nodes', '-days', '2'],
    ...['-subj', '/CN=localhost', '-keyout', key, '-out', cert],
  ], { stdio: 'ignore' }); // prettier-ignore
  const bodies = new Map();
  const options = { key: readFileSync(key), cert: readFileSync(cert) };
  const created = createSecureServer(options, (request, response) => {
    let path = join(site, normalize(decodeURIComponent(new URL(request.url, origin).pathname)));
    if (path.endsWith('/')) path += 'index.html';
    if (!existsSync(path) || !statSync(path).isFile()) return void response.writeHead(404).end();
    const type = TYPES[extname(path)] ?? 'application/octet-stream';
    const isText = COMPRESSED.test(type);
    if (!bodies.has(path)) {
      const bytes = readFileSync(path);
      const quality = { params: { [constants.BROTLI_PARAM_QUALITY]: 9 } };
      bodies.set(path, isText ? brotliCompressSync(bytes, quality) : bytes);
    }
    const headers = { 'content-type': type, 'cache-control': 'max-age=600' };
    response.writeHead(200, isText ? { ...headers, 'content-encoding': 'br' } : headers).end(bodies.get(path));
  });
  await new Promise((resolve) => created.listen(0, 'localhost', resolve));
  return created;
}
