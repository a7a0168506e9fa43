import type { Rule } from 'eslint';
export declare const RETIRED_PARTS: ReadonlyMap<string, string>;
export declare function retiredPartOf(name: string, path: string): string | undefined;
export declare const retiredNames: Rule.RuleModule;
