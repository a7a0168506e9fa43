export interface LabCommand {
  readonly what: string;
  readonly in?: 'chromium' | 'dawn';
  readonly command: readonly string[];
  readonly installs?: boolean;
  readonly smallest?: readonly string[];
}
export const COMMANDS: Readonly<Record<string, LabCommand>>;
