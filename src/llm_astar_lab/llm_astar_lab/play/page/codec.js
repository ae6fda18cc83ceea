// Decoding of what the server sends. All of it is data: numbers are checked, texts are bounded.

const MAX_TEXT = 2000;

/** Return a value as text of at most `limit` characters; an ellipsis says that some was cut. */
export function text(value, limit = MAX_TEXT) {
  const whole = value === null || value === undefined ? '' : String(value);
  return whole.length > limit ? `${whole.slice(0, limit)}…` : whole;
}

/** Return a finite number, else null. */
export function number(value) {
  return typeof value === 'number' && Number.isFinite(value) ? value : null;
}

/** Return up to `limit` points [x, y] of a value; what is no point is left out. */
export function points(value, limit = 200000) {
  if (!Array.isArray(value)) return [];
  return value
    .slice(0, limit)
    .filter((item) => Array.isArray(item) && Number.isFinite(item[0]) && Number.isFinite(item[1]));
}

/** Return up to `limit` objects of a value; what is none is left out. */
export function objects(value, limit) {
  const listed = Array.isArray(value) ? value.slice(0, limit) : [];
  return listed.filter((item) => item !== null && typeof item === 'object');
}

/** Return the bytes of a base64 text, none where it is no such text. */
export function bytes(base64) {
  if (typeof base64 !== 'string') return new Uint8Array();
  try {
    const binary = atob(base64);
    const out = new Uint8Array(binary.length);
    for (let i = 0; i < binary.length; i += 1) out[i] = binary.charCodeAt(i);
    return out;
  } catch {
    return new Uint8Array();
  }
}

/** Return base64 of int32, little endian, as numbers. */
export function int32s(base64) {
  const raw = bytes(base64);
  const view = new DataView(raw.buffer);
  const out = new Int32Array(raw.length >> 2);
  for (let i = 0; i < out.length; i += 1) out[i] = view.getInt32(4 * i, true);
  return out;
}

/** Return the first `count` bits of base64, the highest bit of each byte first, as 0 and 1. */
export function bits(base64, count) {
  const raw = bytes(base64);
  const out = new Uint8Array(count);
  const known = Math.min(count, raw.length * 8);
  for (let i = 0; i < known; i += 1) out[i] = (raw[i >> 3] >> (7 - (i & 7))) & 1;
  return out;
}

/** Return a number with thousands separated and at most `digits` decimals; a dash for none. */
export function shown(value, digits = 0) {
  const known = number(value);
  if (known === null) return '–';
  return known.toLocaleString('en', {
    minimumFractionDigits: digits,
    maximumFractionDigits: digits,
  });
}
