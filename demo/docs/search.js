/** Search through the guide, in the browser: the index is fetched when a visitor starts to type. */
import MiniSearch from 'minisearch';

const MAX = 8;
const query = document.getElementById('query');
const found = document.getElementById('found');
let index;

async function load() {
  const passages = await (await fetch('search.json')).json();
  const made = new MiniSearch({
    fields: ['heading', 'title', 'text'],
    storeFields: ['heading', 'title', 'address', 'text'],
    searchOptions: { boost: { heading: 3, title: 2 }, prefix: true, fuzzy: 0.2, combineWith: 'AND' },
  });
  made.addAll(passages.map((passage, id) => ({ id, ...passage })));
  return made;
}

async function search() {
  const { value } = query;
  index ??= load();
  const results = value.trim() === '' ? [] : (await index).search(value).slice(0, MAX);
  if (value !== query.value) return;
  found.replaceChildren(...results.map(itemOf));
  if (value.trim() !== '' && results.length === 0) found.textContent = 'Nothing found.';
}

function itemOf({ heading, title, address, text }) {
  const item = document.createElement('li');
  const link = Object.assign(document.createElement('a'), { href: address, textContent: heading });
  const words = document.createElement('p');
  words.textContent = `${title}: ${text.trim().replace(/\s+/g, ' ').slice(0, 140)} …`;
  item.append(link, words);
  return item;
}

query.addEventListener('input', search);
