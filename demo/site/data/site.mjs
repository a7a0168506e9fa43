/** Names and ways through the site. */
export default {
  name: '<gaussian-splat>',
  /** The pages that every page leads to. */
  navigation: [
    { title: 'Examples', url: '/examples/' },
    { title: 'Playground', url: '/playground/' },
    { title: 'Compare', url: '/compare/' },
    { title: 'Speed and accuracy', url: '/frontier/' },
    { title: 'Stability', url: '/stability/' },
    { title: 'Benchmark', url: '/bench/' },
    { title: 'Guide', url: '/docs/' },
    { title: 'Reference', url: '/reference/' },
  ],
  /** What the foot of every page leads to. */
  footer: [
    { title: 'Get started', url: '/docs/guide/start/' },
    { title: 'Check a generator', url: '/check/' },
    { title: 'React', url: '/react/' },
    { title: 'Vue', url: '/vue/' },
    { title: 'Contributing', url: '/docs/contributing/' },
    { title: 'Architecture', url: '/docs/architecture/' },
    { title: 'Changelog', url: '/docs/changelog/' },
    { title: 'Licence', url: '/docs/license/' },
    { title: 'Third parties', url: '/docs/third-party/' },
    { title: 'Attribution: scenes', url: '/docs/demo/scenes/attribution/' },
    { title: 'Attribution: generators', url: '/docs/demo/generators/attribution/' },
  ],
};
