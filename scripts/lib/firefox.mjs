/**
 * A Firefox that scripts can drive, by WebDriver BiDi and nothing else: Playwright drives only builds of its own. Needs Node's WebSocket
 * (`node --experimental-websocket` before Node 22).
 */
import { spawn } from 'node:child_process';
import { mkdtempSync, rmSync, writeFileSync } from 'node:fs';
import { tmpdir } from 'node:os';
import { join } from 'node:path';

const START_MS = 60_000;

/**
 * @param preferences of `about:config`, by name
 * @param isHeadless false for a window: on a display that `env` or this process names
 */
export async function launchFirefox({
  executable = 'firefox-esr',
  preferences = {},
  env = {},
  isHeadless = true,
} = {}) {
  const profile = mkdtempSync(join(tmpdir(), 'firefox-'));
  const lines = Object.entries(preferences).map(([name, value]) => `user_pref("${name}", ${JSON.stringify(value)});`);
  writeFileSync(join(profile, 'user.js'), lines.join('\n'));
  const child = spawn(
    executable,
    [
      ...(isHeadless ? ['--headless'] : []),
      '--no-remote',
      '--profile',
      profile,
      '--remote-debugging-port',
      '0',
      'about:blank',
    ],
    { env: { ...process.env, ...env }, stdio: ['ignore', 'ignore', 'pipe'] },
  );
  const close = () =>
    new Promise((resolve) => {
      child.once('exit', () => {
        rmSync(profile, { recursive: true, force: true, maxRetries: 5 });
        resolve();
      });
      child.kill();
    });
  try {
    const socket = await connect(`${await addressOf(child)}/session`);
    const { capabilities } = await socket.send('session.new', { capabilities: {} });
    const { contexts } = await socket.send('browsingContext.getTree', {});
    return { ...socket, tab: contexts[0].context, version: capabilities.browserVersion, close };
  } catch (error) {
    await close();
    throw error;
  }
}

/** Runs with a display for windows: the machine's own, or one of Xvfb (Debian: xvfb). Without one Firefox has no WebGL. @param body gets the environment */
export async function withDisplay(body) {
  if (process.env.DISPLAY) return body({ DISPLAY: process.env.DISPLAY });
  const screen = spawn('Xvfb', ['-displayfd', '3', '-screen', '0', '1280x1024x24'], {
    stdio: ['ignore', 'ignore', 'ignore', 'pipe'],
  });
  try {
    const number = await new Promise((resolve, reject) => {
      screen.once('error', () => reject(new Error('no display, and no Xvfb to make one: apt-get install xvfb')));
      screen.once('exit', (code) => reject(new Error(`Xvfb ended with ${code}`)));
      screen.stdio[3].once('data', (data) => resolve(String(data).trim()));
    });
    return await body({ DISPLAY: `:${number}` });
  } finally {
    screen.kill();
  }
}

/** The address on which it listens, from its output when it is ready. */
function addressOf(child) {
  return new Promise((resolve, reject) => {
    const timer = setTimeout(() => reject(new Error('Firefox does not answer')), START_MS);
    child.once('error', reject);
    child.once('exit', (code) => reject(new Error(`Firefox ended with ${code}`)));
    let said = '';
    child.stderr.on('data', (data) => {
      said += data;
      const [, address] = /WebDriver BiDi listening on (ws:\S+)/.exec(said) ?? [];
      if (address === undefined) return;
      clearTimeout(timer);
      resolve(address);
    });
  });
}

async function connect(address) {
  const socket = new WebSocket(address);
  const waiting = new Map();
  const listeners = [];
  let last = 0;
  socket.addEventListener('message', ({ data }) => {
    const { type, id, method, params, result, error, message } = JSON.parse(data);
    if (type === 'event') for (const listener of listeners) listener(method, params);
    else if (type === 'error') waiting.get(id)?.reject(new Error(`${error}: ${message}`));
    else waiting.get(id)?.resolve(result);
    waiting.delete(id);
  });
  await new Promise((resolve, reject) => {
    socket.addEventListener('open', resolve, { once: true });
    socket.addEventListener('error', () => reject(new Error(`no connection to ${address}`)), { once: true });
  });
  const send = (method, params) =>
    new Promise((resolve, reject) => {
      waiting.set(++last, { resolve, reject });
      socket.send(JSON.stringify({ id: last, method, params }));
    });
  return { send, onEvent: (listener) => listeners.push(listener) };
}

/** A tab of Firefox, and the errors that it has thrown. */
export class FirefoxTab {
  #firefox;
  #origin;
  #exceptions = [];
  #isSubscribed;

  /** @param origin of the pages that it opens */
  constructor(firefox, origin) {
    this.#firefox = firefox;
    this.#origin = origin;
    firefox.onEvent((method, { type, level, text, stackTrace }) => {
      if (method !== 'log.entryAdded' || type !== 'javascript' || level !== 'error') return;
      const { url, lineNumber, columnNumber } = stackTrace?.callFrames[0] ?? {};
      this.#exceptions.push(url ? `${text} (${url}:${lineNumber}:${columnNumber})` : text);
    });
    this.#isSubscribed = firefox.send('session.subscribe', { events: ['log.entryAdded'] });
  }

  /** @param path of the site, or an address */
  async open(path) {
    await this.#isSubscribed;
    await this.#firefox.send('browsingContext.navigate', {
      context: this.#firefox.tab,
      url: new URL(path, this.#origin).href,
      wait: 'complete',
    });
  }

  /** The value of an expression, or of its promise. */
  async evaluate(expression) {
    const answer = await this.#firefox.send('script.evaluate', {
      expression,
      target: { context: this.#firefox.tab },
      awaitPromise: true,
    });
    if (answer.type === 'exception') throw new Error(answer.exceptionDetails.text);
    return answer.result.value;
  }

  /** The top left corner of the page as it is on the screen: bytes of a PNG. */
  async screenshot({ width, height }) {
    const { data } = await this.#firefox.send('browsingContext.captureScreenshot', {
      context: this.#firefox.tab,
      clip: { type: 'box', x: 0, y: 0, width, height },
    });
    return Buffer.from(data, 'base64');
  }

  async perform(source) {
    await this.#firefox.send('input.performActions', { context: this.#firefox.tab, actions: [source] });
    await this.#firefox.send('input.releaseActions', { context: this.#firefox.tab });
  }

  takeExceptions() {
    return this.#exceptions.splice(0);
  }
}
