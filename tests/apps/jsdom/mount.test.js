import '@gaussian-splat/element';
import { expect, test } from 'vitest';

test('the element mounts, says why it cannot draw, and goes', async () => {
  document.body.innerHTML =
    '<gaussian-splat src="/scene.spz" alt="A scene" camera-controls auto-rotate></gaussian-splat>';
  const element = document.querySelector('gaussian-splat');
  await element.ready;
  expect(element.error.code).toBe('unsupported');
  expect(element.getAttribute('alt')).toBe('A scene');
  element.remove();
});
