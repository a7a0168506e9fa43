/** The app of Vue, as Vite has built it. */
import { describeApp } from './support/app.js';

describeApp('Vue', { page: '/demo/dist/vue/index.html', mounts: 200 });
