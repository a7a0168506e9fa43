export function retiredIn(text: string): { found: string; instead: string; at: number }[];
