/** The sentences of documents and pages, without their code: blocks of text with the lines on which they begin. */

const CODE = '`'; // Stands for a piece of code: a single word that no list contains.

/** @returns {{ line: number, text: string, isHeading: boolean, isCell: boolean }[]} paragraphs, items, cells and headings of Markdown. */
export function blocksOfMarkdown(source) {
  const lines = blank(source, /^---\n[\s\S]*?\n---\n/)
    .replace(/^(```|~~~)[^\n]*\n[\s\S]*?^\1/gm, emptied)
    .replace(/<!--[\s\S]*?-->/g, emptied)
    .split('\n');
  const blocks = [];
  let open;
  const close = () => (open = undefined);
  lines.forEach((raw, i) => {
    const line = raw.trim();
    if (line === '' || /^([-*_] ?){3,}$/.test(line) || /^\|[\s:|-]+\|$/.test(line)) return close();
    if (line.startsWith('|')) {
      close();
      for (const cell of line.replace(/\\\|/g, '/').split('|')) push(plain(cell), i, false, true);
      return;
    }
    const starts = /^(#{1,6} |[-*+] |\d+\. |> )/.exec(line);
    if (starts) close();
    const text = starts ? line.slice(starts[0].length) : line;
    if (open) open.text += `\n${plain(text)}`;
    else open = push(plain(text), i, line.startsWith('#'));
    if (open?.isHeading) close();
  });
  return blocks;

  function push(text, i, isHeading = false, isCell = false) {
    if (text.trim() === '') return undefined;
    const block = { line: i + 1, text: text.trim(), isHeading, isCell };
    blocks.push(block);
    return block;
  }
}

/** @returns {{ line: number, text: string }[]} comments in the code of Markdown. */
export function commentsInCode(source) {
  return [...source.matchAll(/^(```|~~~)[^\n]*\n([\s\S]*?)^\1/gm)].flatMap(({ 2: code, index, 0: block }) =>
    [...code.matchAll(/(?:^|\s)(?:\/\/|#|<!--) (.*)/g)].map((comment) => ({
      line: lineAt(source, index + block.indexOf(code) + comment.index + 1),
      text: comment[1].replace(/`[^`]*`/g, CODE),
    })),
  );
}

/** Inline marks taken away: code is one mark, a link its words. */
function plain(text) {
  return text
    .replace(/(`+)[^`]+?\1/g, CODE)
    .replace(/!\[([^\]]*)\]\([^)]*\)/g, '$1')
    .replace(/\[([^\]]*)\]\([^)]*\)/g, '$1')
    .replace(/<\/?[a-z][^>]*>/gi, ' ')
    .replace(/\*\*|__/g, '')
    .replace(/&lt;|&gt;/g, '');
}

const BLOCKS =
  /<\/?(p|h\d|li|ul|ol|dl|dt|dd|td|th|tr|table|caption|div|section|figure|figcaption|button|label|option|summary|details|a class)\b/i;

/** @returns blocks of an HTML page or a Nunjucks template: visible text, and texts of attributes. */
export function blocksOfPage(source) {
  const front = /^---\n([\s\S]*?)\n---\n/.exec(source)?.[1] ?? '';
  const described = front
    .split('\n')
    .map((line, i) => ({ line: i + 2, text: /^(?:title|description): (.*)$/.exec(line)?.[1] ?? '', isHeading: true }));
  const cleared = blank(source, /^---\n[\s\S]*?\n---\n/)
    .replace(/<(script|style|pre)\b[\s\S]*?<\/\1>/g, emptied)
    .replace(/\{#[\s\S]*?#\}|<!--[\s\S]*?-->|\{%[\s\S]*?%\}/g, emptied)
    .replace(/\{\{[\s\S]*?\}\}/g, (found) => CODE + emptied(found))
    .replace(/<code\b[^>]*>[\s\S]*?<\/code>/g, (found) => CODE + emptied(found));
  const blocks = [...described];
  for (const { 0: all, 1: text, index } of cleared.matchAll(/\s(?:alt|title|placeholder|aria-label)="([^"]+)"/g))
    blocks.push({ line: lineAt(cleared, index + all.indexOf(text)), text, isHeading: true });
  let at = 0;
  for (const part of cleared.split(/(<[^>]*>)/)) {
    if (part.startsWith('<')) {
      if (BLOCKS.test(part))
        blocks.push({ line: lineAt(cleared, at), text: '', isHeading: /<h\d|<button|<option/.test(part) });
    } else if (part.trim() !== '') {
      let last = blocks.at(-1);
      if (last === undefined || last.isClosed)
        blocks.push((last = { line: lineAt(cleared, at), text: '', isHeading: false }));
      if (last.text === '') last.line = lineAt(cleared, at + part.search(/\S/));
      last.text += last.text === '' ? part.trimStart() : part;
    }
    at += part.length;
  }
  return blocks.map((block) => ({ ...block, text: unescape(block.text).trim() })).filter(({ text }) => text !== '');
}

/** Sentences of a block. A colon or a semicolon ends none: what stands behind it has to be read with the rest. */
export function sentencesOf(text) {
  return text
    .split(/(?<=[.!?][)”"’]?)\s+(?=[A-Z`“"(<0-9])/)
    .map((sentence) => sentence.trim())
    .filter(Boolean);
}

/** Words that a reader counts: marks alone are none. */
export const wordsOf = (sentence) => sentence.split(/\s+/).filter((word) => /[\p{L}\p{N}`]/u.test(word)).length;

const emptied = (found) => found.replace(/[^\n]/g, '');
const blank = (source, pattern) => source.replace(pattern, emptied);
const lineAt = (source, at) => source.slice(0, at).split('\n').length;
const unescape = (text) =>
  text.replace(/&(lt|gt|amp|quot|nbsp);/g, (_, name) => ({ lt: '<', gt: '>', amp: '&', quot: '"', nbsp: ' ' })[name]);
