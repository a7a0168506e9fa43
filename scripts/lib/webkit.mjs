/** A WebKitGTK that scripts can drive, by WebDriver (Debian: webkit2gtk-driver and xvfb). */
import { spawn } from 'node:child_process';
import { existsSync, readdirSync } from 'node:fs';
import { createServer } from 'node:net';
import { join } from 'node:path';

const START_MS = 60_000;
/** Timeout of one script in a page: software rendering is slow. */
const SCRIPT_MS = 180_000;

/** @param env has DISPLAY */
export async function launchWebKit({ env = {} } = {}) {
  const port = await freePort();
  const child = spawn('WebKitWebDriver', [`--port=${port}`], { env: { ...process.env, ...env }, stdio: 'ignore' });
  const failed = new Promise((_, reject) => {
    child.once('error', () => reject(new Error('no WebKitWebDriver: apt-get install webkit2gtk-driver xvfb')));
  });
  failed.catch(() => undefined);
  const send = async (method, path, body) => {
    const answer = await fetch(`http://127.0.0.1:${port}${path}`, {
      method,
      ...(body && { body: JSON.stringify(body), headers: { 'content-type': 'application/json' } }),
    });
    const { value } = await answer.json();
    if (!answer.ok) throw new Error(`${value.error}: ${value.message}`);
    return value;
  };
  const close = async () => {
    const ended = new Promise((resolve) => child.once('exit', resolve));
    child.kill();
    await ended;
  };
  try {
    const options = { binary: miniBrowser(), args: ['--automation'] };
    const alwaysMatch = { 'webkitgtk:browserOptions': options, timeouts: { script: SCRIPT_MS, pageLoad: SCRIPT_MS } };
    const { sessionId, capabilities } = await Promise.race([begin(send, { capabilities: { alwaysMatch } }), failed]);
    const session = `/session/${sessionId}`;
    return {
      version: capabilities.browserVersion,
      send: (method, path, body) => send(method, session + path, body),
      close: () => send('DELETE', session).then(close, close),
    };
  } catch (error) {
    await close();
    throw error;
  }
}

/** The driver takes a moment to listen. */
async function begin(send, body) {
  for (const end = Date.now() + START_MS; ;) {
    try {
      return await send('POST', '/session', body);
    } catch (error) {
      if (!(error instanceof TypeError) || Date.now() > end) throw error;
      await new Promise((resolve) => setTimeout(resolve, 200));
    }
  }
}

/** The browser that comes with the library; the driver finds only that of another version. */
function miniBrowser() {
  const found = ['/usr/lib', '/usr/libexec']
    .flatMap((folder) => (existsSync(folder) ? [folder, ...readdirSync(folder).map((name) => join(folder, name))] : []))
    .flatMap((folder) => ['4.1', '6.0', '4.0'].map((api) => `${folder}/webkit2gtk-${api}/MiniBrowser`))
    .find(existsSync);
  if (found === undefined) throw new Error('no MiniBrowser of WebKitGTK: apt-get install webkit2gtk-driver');
  return found;
}

/** A tab of WebKit, with what `FirefoxTab` has. */
export class WebKitTab {
  #webkit;
  #origin;
  #thrown = [];

  constructor(webkit, origin) {
    this.#webkit = webkit;
    this.#origin = origin;
  }

  /** @param path of the site, or an address */
  async open(path) {
    await this.#keepThrown();
    await this.#webkit.send('POST', '/url', { url: new URL(path, this.#origin).href });
  }

  /** The value of an expression, or of its promise. */
  async evaluate(expression) {
    const script = `const done = arguments[arguments.length - 1];
      (async () => (${expression}))().then((value) => done({ value }), (error) => done({ error: String(error) }));`;
    const { value, error } = await this.#webkit.send('POST', '/execute/async', { script, args: [] });
    if (error) throw new Error(error);
    return value ?? undefined;
  }

  /** The whole window: bytes of a PNG. */
  async screenshot() {
    return Buffer.from(await this.#webkit.send('GET', '/screenshot'), 'base64');
  }

  async perform(source) {
    await this.#webkit.send('POST', '/actions', { actions: [source] });
    // The driver would turn a wheel back.
    if (source.type !== 'wheel') await this.#webkit.send('DELETE', '/actions');
  }

  /** Errors that the pages themselves have recorded (`window.thrown`), since WebDriver reports none. */
  async takeExceptions() {
    await this.#keepThrown();
    return this.#thrown.splice(0);
  }

  async #keepThrown() {
    const found = await this.evaluate('JSON.stringify((window.thrown ?? []).splice(0))').catch(() => '[]');
    this.#thrown.push(...JSON.parse(found));
  }
}

function freePort() {
  return new Promise((resolve) => {
    const server = createServer().listen(0, '127.0.0.1', () => {
      const { port } = server.address();
      server.close(() => resolve(port));
    });
  });
}
