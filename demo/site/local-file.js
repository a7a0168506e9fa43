/** A file of the visitor's own, as a source for the element. Nothing leaves the machine. */

let objectUrl;

/** The address of a local file; its fragment contains the name, since the name alone identifies some formats. */
export function addressOf(file) {
  if (objectUrl) URL.revokeObjectURL(objectUrl);
  objectUrl = URL.createObjectURL(file);
  return `${objectUrl}#${encodeURIComponent(file.name)}`;
}

/**
 * Takes files that are dropped on a field or chosen in the input within it.
 * @param field {HTMLElement}
 * @param open {(file: File) => void}
 */
export function takeFiles(field, open) {
  field.querySelector('input[type=file]').addEventListener('change', ({ target }) => {
    if (target.files.length > 0) open(target.files[0]);
  });
  // A file that misses the field would otherwise replace the page.
  for (const type of ['dragover', 'drop']) addEventListener(type, (event) => event.preventDefault());
  for (const type of ['dragenter', 'dragover']) field.addEventListener(type, () => field.classList.add('over'));
  for (const type of ['dragleave', 'drop']) field.addEventListener(type, () => field.classList.remove('over'));
  field.addEventListener('drop', (event) => {
    const [file] = event.dataTransfer.files;
    if (file) open(file);
  });
}
