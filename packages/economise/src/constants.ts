/** The constant spherical harmonic, 1/(2·sqrt(pi)). */
export const SH_C0 = 0.28209479177387814;
