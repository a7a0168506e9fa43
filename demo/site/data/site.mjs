/** Names and ways through the site. */
export default {
  name: 'gaussian-splat',
  /** The site's address for crawlers and previews of links; unknown unless SITE_URL is set. */
  address: process.env.SITE_URL ?? '',
  /** The pages that every page leads to; the name of each is its heading, too. */
  navigation: [
    { title: 'Gallery', url: '/gallery/' },
    { title: 'Examples', url: '/examples/' },
    { title: 'Playground', url: '/playground/' },
    { title: 'Guide', url: '/docs/' },
    { title: 'Reference', url: '/reference/' },
    { title: 'Speed and accuracy', url: '/speed/' },
  ],
  /** Pages of one subject, which lead to one another. */
  groups: [
    {
      name: 'Examples',
      pages: [
        { title: 'Examples', url: '/examples/' },
        { title: 'Ten features', url: '/examples/features/' },
        { title: 'Cuts, shadows, skies and videos', url: '/examples/effects/' },
        { title: 'Check a generator', url: '/check/' },
      ],
    },
    {
      name: 'Speed and accuracy',
      pages: [
        { title: 'Speed and accuracy', url: '/speed/' },
        { title: 'Compare two qualities', url: '/compare/' },
        { title: 'Hard cases', url: '/stability/' },
        { title: 'Measure this machine', url: '/bench/' },
      ],
    },
  ],
  /** Links of every page's footer. */
  footer: [
    { title: 'Get started', url: '/docs/guide/start/' },
    { title: 'Splats in three.js', url: '/three/' },
    { title: 'Splats in three.js with WebGL', url: '/three-webgl/' },
    { title: 'Splats on a map', url: '/map/' },
    { title: 'Without WebGPU', url: '/without-webgpu/' },
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
