import react from '@vitejs/plugin-react';
import { defineConfig } from 'vite';

export default defineConfig({
  root: import.meta.dirname,
  base: './',
  plugins: [react()],
  // The element's worker loads its readers on demand, and only ES modules can.
  worker: { format: 'es' },
  // Eleventy writes the page (index.njk); here its script is made, with a name that the page can know.
  build: {
    outDir: '../dist/react',
    emptyOutDir: false,
    target: 'es2022',
    chunkSizeWarningLimit: 2000,
    rollupOptions: { input: 'main.tsx', output: { entryFileNames: 'assets/app.js' } },
  },
});
