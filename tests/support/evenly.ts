/** Some of the cases of a test, evenly chosen. @param count how many, at most */
export function evenly<T>(cases: readonly T[], count: number): readonly T[] {
  if (cases.length <= count) return cases;
  return Array.from({ length: count }, (_, k) => cases[Math.floor((k * cases.length) / count)]);
}
