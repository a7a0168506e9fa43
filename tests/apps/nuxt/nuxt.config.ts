export default defineNuxtConfig({
  telemetry: false,
  app: { head: { link: [{ rel: 'icon', href: 'data:,' }] } },
  vue: { compilerOptions: { isCustomElement: (tag: string) => tag === 'gaussian-splat' } },
  hooks: {
    // Otherwise visitors download all code that some page may need: docs/guide/vue.md.
    'build:manifest': (manifest) => {
      for (const chunk of Object.values(manifest)) chunk.dynamicImports = [];
    },
  },
});
