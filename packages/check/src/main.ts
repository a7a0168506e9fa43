import { parseArgs } from 'node:util';
import { writeFile } from 'node:fs/promises';
import { basename } from 'node:path';
import { carriesContract, describeFault, sidecarPath, type ReportSection } from '@gaussian-splat/core/contract';
import { readOnnxHeader } from '@gaussian-splat/core/onnx';
import { draftContract } from './draft-contract.js';
import { openModel } from './model-location.js';
import { checkModel, type CheckFault, type CheckReport } from './check-model.js';

const usageOf = (command: string): string => `Usage: ${command} MODEL [--contract CONTRACT.json] [--run] [--draft]

Checks an ONNX file (a path or an address) against the Gaussian Generator contract.

  --contract FILE   the contract; otherwise the model's metadata, NAME.contract.json beside it, or its names
  --run             run the model on the CPU, too, and check its values
  --draft           write the contract that the model lacks beside it, as NAME.contract.json, and say what to decide;
                    of a model at an address, to the working directory

Exit status: 0 if it keeps the contract, 1 if not, 2 if the command is wrong.`;

/**
 * Runs the command and prints tables and faults.
 * @param args Arguments without the name of the program.
 * @param command Words that run the program, for the texts that name it.
 * @returns The exit status: 0, 1 for faults, 2 for wrong arguments.
 */
export async function main(args: readonly string[], command = 'gaussian-check'): Promise<number> {
  const usage = usageOf(command);
  let parsed: ReturnType<typeof parse>;
  try {
    parsed = parse(args);
  } catch (error) {
    console.error(`${(error as Error).message}\n\n${usage}`);
    return 2;
  }
  const { values, positionals } = parsed;
  if (values.help) {
    console.log(usage);
    return 0;
  }
  if (positionals.length !== 1) {
    console.error(`Expected one model, found ${positionals.length}.\n\n${usage}`);
    return 2;
  }
  if (values.draft && (values.run || values.contract !== undefined)) {
    console.error(
      `--draft writes a contract and checks nothing: expected no --run or --contract beside it.\n\n${usage}`,
    );
    return 2;
  }
  if (values.draft) return draft(positionals[0], command);
  const report = await checkModel(positionals[0], { contract: values.contract, run: values.run });
  console.log(formatReport(positionals[0], report, values.run ?? false));
  return report.faults.length > 0 ? 1 : 0;
}

function parse(args: readonly string[]) {
  return parseArgs({
    args: [...args],
    allowPositionals: true,
    options: {
      contract: { type: 'string' },
      run: { type: 'boolean' },
      draft: { type: 'boolean' },
      help: { type: 'boolean', short: 'h' },
    },
  });
}

/** Writes the draft of a contract next to the model, unless the file exists. Returns the exit status. */
async function draft(model: string, command: string): Promise<number> {
  const isRemote = URL.canParse(model) && /^https?:/i.test(model);
  // A contract for a model on a server is written to the working directory.
  const path = sidecarPath(isRemote ? basename(new URL(model).pathname) : model);
  try {
    const location = await openModel(model);
    const header = await readOnnxHeader(location.source);
    await location.close();
    if (carriesContract(header)) {
      console.error(`${model} contains its contract, which is read before a file beside it: check it without --draft.`);
      return 1;
    }
    const { contract, questions } = draftContract(header);
    await writeFile(path, `${JSON.stringify(contract, undefined, 2)}\n`, { flag: 'wx' });
    console.log([`wrote ${path}. To be decided:`, ...questions.map((question) => `  ${question}`)].join('\n'));
    console.log(`Then: ${command} "${model}"${isRemote ? ` --contract "${path}"` : ''} --run`);
    return 0;
  } catch (error) {
    const isThere = (error as { code?: string }).code === 'EEXIST';
    console.error(isThere ? `${path} exists already: delete it first.` : (error as Error).message);
    return 1;
  }
}

/** Returns the report as text for a terminal. @param isRun Whether the model was run, too. */
export function formatReport(model: string, { sections, faults, warnings }: CheckReport, isRun: boolean): string {
  const tables = sections.map(formatSection);
  const notes =
    warnings.length > 0 ? ['Warning: no contract was found; it was inferred from names. Write one to be sure.'] : [];
  const verdict =
    faults.length > 0
      ? [
          `${model}: ${faults.length} fault${faults.length > 1 ? 's' : ''}`,
          ...faults.map((fault) => `  ${lineOf(fault)}`),
        ]
      : [`${model}: keeps the contract${isRun ? ', header and values' : ' (header; --run checks values, too)'}`];
  return [...tables, ...notes, verdict.join('\n')].join('\n\n');
}

const lineOf = (fault: CheckFault): string => (fault instanceof Error ? fault.message : describeFault(fault));

function formatSection({ title, rows }: ReportSection): string {
  const widths: number[] = [];
  for (const row of rows) row.forEach((cell, i) => (widths[i] = Math.max(widths[i] ?? 0, cell.length)));
  // The last column is not padded.
  const lines = rows.map((row) =>
    row.map((cell, i) => (i < row.length - 1 ? cell.padEnd(widths[i]) : cell)).join('  '),
  );
  return [title, ...lines.map((line) => `  ${line.trimEnd()}`)].join('\n');
}
