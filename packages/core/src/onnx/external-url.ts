import { partUrl } from '../file-request.js';

/**
 * Returns the address of an external file of a model. Its location is a path and not a URL, so `#`, `?` and `%` are parts
 * of its name. Undefined if the address of the model has no folder (`blob:`, `data:`).
 * @param location Relative path that the model declares.
 * @param model Absolute address of the model.
 */
export function externalUrl(location: string, model: string | URL): URL | undefined {
  const path = location
    .split(/[/\\]/)
    .map((part) => encodeURIComponent(part))
    .join('/');
  return URL.canParse(path, model) ? partUrl(path, model) : undefined;
}
