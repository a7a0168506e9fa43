export declare const RETIRED_PARTS: ReadonlyMap<string, string>;
export declare function retiredPartOf(name: string, path: string): string | undefined;
