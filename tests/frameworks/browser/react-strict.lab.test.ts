/** The app of React under StrictMode in React's development build, which mounts everything twice. */
import { describeApp } from './support/app.js';

describeApp('React under StrictMode', { page: '/net/react-development/', mounts: 200, effects: 2 });
