import vue from '@vitejs/plugin-vue';
import { defineConfig } from 'vite';

export default defineConfig({
  root: import.meta.dirname,
  base: './',
  plugins: [vue({ template: { compilerOptions: { isCustomElement: (tag) => tag === 'gaussian-splat' } } })],
  // The element's worker loads its readers on demand, and only ES modules can.
  worker: { format: 'es' },
  // Eleventy writes the page (index.njk); here its script is made, with a name that the page can know.
  build: {
    outDir: '../dist/vue',
    emptyOutDir: false,
    target: 'es2022',
    chunkSizeWarningLimit: 2000,
    rollupOptions: { input: 'main.ts', output: { entryFileNames: 'assets/app.js' } },
  },
});
