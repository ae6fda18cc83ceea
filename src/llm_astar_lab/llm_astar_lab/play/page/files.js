// Files that are dropped onto the page or chosen: maps go to the server, GeoJSON stays here.

import { featuresOf } from './shapes.js';

const GEOJSON = /\.(geo)?json$/i;

/** Call `onFiles` with the files that are dropped or chosen, as a list. */
export function listenToFiles(target, input, onFiles) {
  const show = (isOver) => target.classList.toggle('dropping', isOver);
  addEventListener('dragover', (event) => {
    event.preventDefault();
    show(true);
  });
  addEventListener('dragleave', (event) => event.relatedTarget || show(false));
  addEventListener('drop', (event) => {
    event.preventDefault();
    show(false);
    if (event.dataTransfer.files.length) onFiles([...event.dataTransfer.files]);
  });
  input.addEventListener('change', () => {
    onFiles([...input.files]);
    input.value = '';
  });
}

/** Return the files of a map as {name: contents in base64}, and the features of all GeoJSON. */
export async function readFiles(files) {
  const [maps, features] = [{}, []];
  for (const file of files) {
    if (GEOJSON.test(file.name)) features.push(...(await readFeatures(file)));
    else maps[file.name] = await inBase64(file);
  }
  return { maps, features };
}

async function readFeatures(file) {
  try {
    return featuresOf(JSON.parse(await file.text()));
  } catch (error) {
    throw new Error(`${file.name}: ${error.message}`);
  }
}

function inBase64(file) {
  return new Promise((resolve, reject) => {
    const reader = new FileReader();
    reader.addEventListener('load', () => resolve(reader.result.split(',')[1] ?? ''));
    reader.addEventListener('error', () => reject(new Error(`${file.name} cannot be read.`)));
    reader.readAsDataURL(file);
  });
}
