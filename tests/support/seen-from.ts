/** Splats that are seen from some directions. */
/** Basis functions up to degree 2 in a unit direction, as shaders/shared/sh.wgsl has them. */
export function basisOf([x, y, z]: readonly number[]): number[] {
  const [a, b] = [1.0925484305920792, 0.31539156525252005];
  return [
    ...[0.28209479177387814, -0.4886025119029199 * y, 0.4886025119029199 * z, -0.4886025119029199 * x],
    ...[a * x * y, -a * y * z, b * (2 * z * z - x * x - y * y), -a * x * z, (a / 2) * (x * x - y * y)],
  ];
}

/** Directions in a cone of 50 degrees around z. */
export function cone(count: number, random: () => number): number[][] {
  return Array.from({ length: count }, () => {
    const height = 1 - random() * (1 - Math.cos(0.87));
    const turn = 2 * Math.PI * random();
    const across = Math.sqrt(1 - height * height);
    return [across * Math.cos(turn), across * Math.sin(turn), height];
  });
}

/** Lower triangular root of the mean of Y Yᵀ, and a hundredth of what directions from everywhere would add. */
export function rootOf(directions: readonly number[][]): number[] {
  const bases = directions.map(basisOf);
  const root: number[] = [];
  for (let r = 0; r < 9; r++) {
    for (let c = 0; c <= r; c++) {
      let rest = bases.reduce((sum, basis) => sum + basis[r] * basis[c], 0) / bases.length + (r === c ? 8e-4 : 0);
      for (let j = 0; j < c; j++) rest -= root[(r * (r + 1)) / 2 + j] * root[(c * (c + 1)) / 2 + j];
      root.push(r === c ? Math.sqrt(rest) : rest / root[(c * (c + 3)) / 2]);
    }
  }
  return root;
}
