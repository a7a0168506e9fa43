export interface Block {
  readonly line: number;
  readonly text: string;
  readonly isHeading: boolean;
}
export function blocksOfMarkdown(source: string): Block[];
export function commentsInCode(source: string): { line: number; text: string }[];
export function blocksOfPage(source: string): Block[];
export function sentencesOf(text: string): string[];
export function wordsOf(sentence: string): number;
