/** Child processes of the tests: several at once, what each prints kept apart. */
import { spawn } from 'node:child_process';
import { constants, setPriority } from 'node:os';
import { root } from './run.mjs';

/**
 * Runs a command and returns what it printed, without colors, and its exit status. A command that runs `beside` another takes the CPU time that is left, and prints its output in one piece when it ends.
 */
export function runAsync(command, args, { env = {}, isBeside = false } = {}) {
  const child = spawn(command, args, {
    cwd: root,
    env: { ...process.env, ...env },
    stdio: ['ignore', 'pipe', isBeside ? 'pipe' : 'inherit'],
  });
  if (isBeside) giveWay(child.pid);
  const chunks = [];
  const keep = (chunk) => {
    chunks.push(chunk);
    if (!isBeside) process.stdout.write(chunk);
  };
  child.stdout.on('data', keep);
  child.stderr?.on('data', keep);
  return new Promise((resolve) => {
    const end = (status) => {
      const text = Buffer.concat(chunks).toString();
      if (isBeside) process.stdout.write(text);
      resolve({ text: withoutColors(text), status: status ?? 1 });
    };
    child.on('error', () => end(1)).on('close', end);
  });
}

/** The lowest CPU priority that a process can request. */
function giveWay(pid) {
  try {
    setPriority(pid, constants.priority.PRIORITY_LOW);
  } catch {
    // A system that does not let it: then it runs as the rest does.
  }
}

function withoutColors(text) {
  return text.replace(/\u001b\[[0-9;]*[A-Za-z]/g, '');
}
