// Short words to the user: a line above the map, and one that passes.

const SECONDS = 2.6;
const $ = (id) => document.getElementById(id);
let timer;

/** Write a line above the map, or remove it. */
export function say(sentence) {
  $('notice').textContent = sentence;
  $('notice').hidden = !sentence;
}

/** Copy a text, and say that it is done or why not. */
export async function copy(content, done) {
  try {
    await navigator.clipboard.writeText(content);
    toast(done);
  } catch {
    toast('The browser does not allow copying here; select the text instead.');
  }
}

function toast(sentence) {
  $('toast').textContent = sentence;
  $('toast').classList.add('shown');
  clearTimeout(timer);
  timer = setTimeout(() => $('toast').classList.remove('shown'), 1000 * SECONDS);
}
