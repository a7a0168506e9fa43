import { pluginReact } from '@rsbuild/plugin-react';

export default {
  plugins: [pluginReact()],
  html: { title: 'App', tags: [{ tag: 'link', attrs: { rel: 'icon', href: 'data:,' } }] },
};
