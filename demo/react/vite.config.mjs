import react from '@vitejs/plugin-react';
import { defineConfig } from 'vite';

export default defineConfig({
  root: import.meta.dirname,
  base: './',
  plugins: [react()],
  // The element's worker loads its readers on demand, and only ES modules can.
  worker: { format: 'es' },
  build: { outDir: '../dist/react', emptyOutDir: true, target: 'es2022', chunkSizeWarningLimit: 2000 },
});
