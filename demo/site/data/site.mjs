/** Names and ways through the site. */
export default {
  name: 'gaussian-splat',
  /** The site's address for crawlers and previews of links; unknown unless SITE_URL is set. */
  address: process.env.SITE_URL ?? '',
  /** The pages that every page leads to. */
  navigation: [
    { title: 'Gallery', url: '/gallery/' },
    { title: 'Examples', url: '/examples/features/' },
    { title: 'Playground', url: '/playground/' },
    { title: 'Guide', url: '/docs/' },
    { title: 'Reference', url: '/reference/' },
    { title: 'Performance', url: '/frontier/' },
  ],
  /** The pages that measure, which lead to one another. */
  measured: [
    { title: 'Speed and accuracy', url: '/frontier/' },
    { title: 'Compare two qualities', url: '/compare/' },
    { title: 'Hard cases', url: '/stability/' },
    { title: 'Measure this machine', url: '/bench/' },
  ],
  /** Links of every page's footer. */
  footer: [
    { title: 'Get started', url: '/docs/guide/start/' },
    { title: 'Generators', url: '/examples/' },
    { title: 'In three.js', url: '/three/' },
    { title: 'In three.js with WebGL', url: '/three-webgl/' },
    { title: 'On a map', url: '/map/' },
    { title: 'Without WebGPU', url: '/without-webgpu/' },
    { title: 'Check a generator', url: '/check/' },
    { title: 'React', url: '/react/' },
    { title: 'Vue', url: '/vue/' },
    { title: 'Contributing', url: '/docs/contributing/' },
    { title: 'Architecture', url: '/docs/architecture/' },
    { title: 'Changelog', url: '/docs/changelog/' },
    { title: 'License', url: '/docs/license/' },
    { title: 'Third parties', url: '/docs/third-party/' },
    { title: 'Attribution: scenes', url: '/docs/demo/scenes/attribution/' },
    { title: 'Attribution: generators', url: '/docs/demo/generators/attribution/' },
  ],
};
