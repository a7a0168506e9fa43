/** The app of React, as Vite has built it for production: StrictMode does nothing there. */
import { describeApp } from './support/app.js';

describeApp('React', { page: '/demo/dist/react/index.html', mounts: 40, effects: 1 });
