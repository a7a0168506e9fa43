/** Serves the tests, which are TypeScript, as JavaScript. Types are checked by tsc, not here. */
import { transform } from 'esbuild';

export function typescript() {
  return {
    name: 'typescript',
    resolveMimeType: ({ path }) => (path.endsWith('.ts') ? 'js' : undefined),
    // Tests name their imports by the files that a compiler would write.
    resolveImport: ({ source, context }) =>
      context.path.endsWith('.ts') && /^\.{1,2}\/.*\.js$/.test(source) ? source.replace(/\.js$/, '.ts') : undefined,
    transform: async ({ path, body }) => {
      if (!path.endsWith('.ts')) return undefined;
      const { code } = await transform(String(body), {
        loader: 'ts',
        target: 'es2022',
        sourcemap: 'inline',
        sourcefile: path,
      });
      return code;
    },
  };
}
