#!/usr/bin/env node
/** `gaussian-splat COMMAND ...`: each command is a module of src/, which reads the arguments after its name. */
const COMMANDS = {
  render: 'one frame of a scene as PNG or float32, without a browser',
  video: 'a camera path or a turntable as PNG files, mp4 or webm, without a browser',
  page: 'a folder with a page that shows a scene, for any static host',
  detail: 'a scene as a folder that is streamed from static hosting',
  optimize: 'a smaller scene of a given PSNR or size',
  sequence: 'a sequence of scenes as a clip, or as its first frame and the motion after it',
  floor: 'the floor of a scene, on which visitors of a page can walk',
  check: 'whether an ONNX generator keeps its contract',
};

const [command] = process.argv.splice(2, 1);
if (Object.hasOwn(COMMANDS, command ?? '')) await import(`../src/${command}.mjs`);
else {
  const lines = Object.entries(COMMANDS).map(([name, text]) => `  ${name.padEnd(10)} ${text}`);
  const { PROGRAM } = await import('../src/lib/command.mjs');
  const usage = `usage: ${PROGRAM} COMMAND ..., or ${PROGRAM} COMMAND --help\n\n${lines.join('\n')}`;
  const isAsked = command === undefined || ['--help', '-h', 'help'].includes(command);
  if (isAsked) console.log(usage);
  else console.error(`expected a command, found "${command}"\n\n${usage}`);
  process.exitCode = isAsked ? 0 : 2;
}
