"use strict";
// The functions of the page that draw nothing. `viewing/camera.py`, `viewing/motion.py` and
// `viewing/colour_scale.py` hold the same in Python.

const DISTANCE = 5.0; // of the camera, in radii of the picture
const FILLED = 0.42; // the radius, as a part of the picture's smaller side

// Numbers of a packed array { data: base64 of little-endian float32, shape }.
function decode(packed) {
  const text = atob(packed.data);
  const bytes = new Uint8Array(text.length);
  for (let i = 0; i < text.length; i++) bytes[i] = text.charCodeAt(i);
  const view = new DataView(bytes.buffer);
  const numbers = new Float32Array(text.length / 4);
  for (let i = 0; i < numbers.length; i++) numbers[i] = view.getFloat32(4 * i, true);
  return numbers;
}

// Product of two 3 x 3 matrices, stored by rows.
function product(a, b) {
  const c = new Array(9);
  for (let i = 0; i < 3; i++)
    for (let j = 0; j < 3; j++)
      c[3 * i + j] = a[3 * i] * b[j] + a[3 * i + 1] * b[3 + j] + a[3 * i + 2] * b[6 + j];
  return c;
}

function transposed(a) {
  return [a[0], a[3], a[6], a[1], a[4], a[7], a[2], a[5], a[8]];
}

function applied(a, p) {
  return [0, 3, 6].map((i) => a[i] * p[0] + a[i + 1] * p[1] + a[i + 2] * p[2]);
}

// Rotation from the axes of the first view (right, up, towards the viewer) to those of the camera.
function turn(yaw, pitch) {
  const [c, s, k, t] = [Math.cos(yaw), Math.sin(yaw), Math.cos(pitch), Math.sin(pitch)];
  return product([1, 0, 0, 0, k, -t, 0, t, k], [c, 0, s, 0, 1, 0, -s, 0, c]);
}

// A position whose part across the unit vector `straight` is multiplied by a factor.
function exaggerated(p, straight, factor) {
  const along = p[0] * straight[0] + p[1] * straight[1] + p[2] * straight[2];
  return p.map((x, k) => along * straight[k] + factor * (x - along * straight[k]));
}

// Pixels of a point in camera axes [m], and its enlargement; NaN behind the camera.
function project(p, camera) {
  const distance = DISTANCE * camera.radius;
  const gap = distance - p[2];
  const scale = (camera.zoom * FILLED * Math.min(camera.width, camera.height)) / camera.radius;
  const size = gap > 0.01 * distance ? (scale * distance) / gap : NaN;
  return [0.5 * camera.width + size * p[0], 0.5 * camera.height - size * p[1], size / scale];
}

// Red, green and blue of a colour #rrggbb.
function channels(colour) {
  return [1, 3, 5].map((i) => parseInt(colour.slice(i, i + 2), 16));
}

// The colour of a value between low and high, [red, green, blue]; NaN has the colour `none`.
function colourOf(value, low, high, stops, none) {
  if (!Number.isFinite(value)) return channels(none);
  const share = high > low ? Math.min(Math.max((value - low) / (high - low), 0), 1) : 0.5;
  const place = share * (stops.length - 1);
  const first = Math.min(Math.floor(place), stops.length - 2);
  const [a, b] = [channels(stops[first]), channels(stops[first + 1])];
  return a.map((x, k) => (1 - (place - first)) * x + (place - first) * b[k]);
}

// Smallest and largest finite number; 0 and 0 if there is none.
function rangeOf(numbers) {
  let [low, high] = [Infinity, -Infinity];
  for (const x of numbers)
    if (Number.isFinite(x)) {
      if (x < low) low = x;
      if (x > high) high = x;
    }
  return low <= high ? [low, high] : [0, 0];
}

// Index of the entry of increasing times that is nearest to a time.
function nearest(times, time) {
  let [low, high] = [0, times.length - 1];
  while (high - low > 1) {
    const middle = (low + high) >> 1;
    if (times[middle] <= time) low = middle;
    else high = middle;
  }
  return time - times[low] <= times[high] - time ? low : high;
}

// Three to six round numbers between low and high, which differ.
function ticks(low, high) {
  const size = Math.pow(10, Math.floor(Math.log10((high - low) / 2)));
  const step = [5, 2, 1].map((digit) => digit * size).find((x) => 2 * x <= high - low);
  const found = [];
  for (let k = Math.ceil(low / step); k * step <= high; k++) found.push(Number((k * step).toPrecision(6)));
  return found;
}

// Texts beside each other that do not overlap, [left end, text]. Each entry, in the order of x, has its x
// and its versions, the longest first; a text ends at x where there is no room up to `right`. Where no
// version has room the text is left out.
function placedTexts(entries, right, widthOf) {
  const found = [];
  let taken = -Infinity;
  for (const [x, versions] of entries)
    for (const text of versions) {
      const width = widthOf(text);
      const start = x + width <= right ? x : x - width;
      if (start < taken) continue;
      found.push([start, text]);
      taken = start + width + 6;
      break;
    }
  return found;
}

// A number with five digits.
function digits(x) {
  if (!Number.isFinite(x)) return "\u2013";
  const size = Math.abs(x);
  if (size !== 0 && (size < 1e-3 || size >= 1e6)) return x.toExponential(4);
  return String(Number(x.toPrecision(5)));
}

if (typeof module !== "undefined")
  module.exports = { decode, product, transposed, applied, turn, exaggerated, project, colourOf, rangeOf,
    nearest, ticks, placedTexts, digits };
