/** Copies the code of an example. */
import { copy } from '../../site/copy.js';

for (const button of document.querySelectorAll('[data-copy]')) {
  button.addEventListener('click', async () => {
    const words = button.closest('.words');
    words.querySelector('output').textContent = await copy(words.querySelector('code').textContent);
  });
}
