import vue from '@vitejs/plugin-vue';
import { defineConfig } from 'vite';

export default defineConfig({
  root: import.meta.dirname,
  base: './',
  plugins: [vue({ template: { compilerOptions: { isCustomElement: (tag) => tag === 'gaussian-splat' } } })],
  // The element's worker loads its readers on demand, and only ES modules can.
  worker: { format: 'es' },
  build: { outDir: '../dist/vue', emptyOutDir: true, target: 'es2022', chunkSizeWarningLimit: 2000 },
});
