/**
 * Reports the options that a renderer reads, so that no figure is published under the name of an option that does not
 * exist.
 */

/**
 * Options that note which of their properties are read.
 * @returns {{options: object, unread: () => string[]}}
 */
export function watchOptions(given) {
  const read = new Set();
  const options = new Proxy(given, {
    get(target, name, receiver) {
      read.add(name);
      return Reflect.get(target, name, receiver);
    },
  });
  return { options, unread: () => Object.keys(given).filter((name) => !read.has(name)) };
}
