/** The same in plain HTML, with the CDN build of another origin. */
import { describeApp } from './support/app.js';

describeApp('plain HTML', { page: '/net/plain-app/', mounts: 200 });
