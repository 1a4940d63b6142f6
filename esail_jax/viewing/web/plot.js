// A small plot of an observable against time, with a cursor.

const MARGINS = { left: 64, right: 10, top: 18, bottom: 20 };
const MOST_NAMED = 3; // components that are told one by one
const DASHES = [[], [6, 3], [2, 2]]; // of the runs
const DASH_NAMES = ["solid", "dashed", "dotted"];

// Draws an observable of several runs and a cursor at `time`.
function drawPlot(canvas, runs, name, time, theme) {
  const { pen, width, height } = cleared(canvas);
  const shown = runs.filter((run) => run.signals[name]);
  if (!shown.length) return;
  const [low, high] = padded(rangeOf(shown.map((run) => rangeOf(heldValues(run, run.signals[name]))).flat()));
  const end = Math.max(...runs.map((run) => run.time[run.time.length - 1])) || 1;
  const x = (t) => MARGINS.left + ((width - MARGINS.left - MARGINS.right) * t) / end;
  const y = (v) => height - MARGINS.bottom - ((height - MARGINS.top - MARGINS.bottom) * (v - low)) / (high - low);
  pen.strokeStyle = theme.faint;
  pen.fillStyle = theme.soft;
  pen.lineWidth = 1;
  pen.textAlign = "right";
  for (const v of ticks(low, high)) {
    polyline(pen, [[x(0), y(v)], [x(end), y(v)]]);
    pen.fillText(digits(v), MARGINS.left - 6, y(v) + 4);
  }
  const { unit } = shown[0].signals[name];
  pen.fillText(unit === "-" ? "" : unit, MARGINS.left - 6, 11);
  pen.textAlign = "left";
  pen.fillText("0 s", x(0), height - 5);
  pen.textAlign = "right";
  pen.fillText(`${digits(end)} s`, x(end), height - 5);
  pen.save();
  pen.beginPath();
  pen.rect(MARGINS.left, MARGINS.top, width - MARGINS.left - MARGINS.right, height - MARGINS.top - MARGINS.bottom);
  pen.clip(); // of a released tether, which the range does not follow
  shown.forEach((run) => {
    const { values, width: columns } = run.signals[name];
    pen.setLineDash(DASHES[runs.indexOf(run) % DASHES.length]);
    for (let k = 0; k < columns; k++) {
      pen.strokeStyle = theme.curves[k % theme.curves.length];
      pen.globalAlpha = columns > MOST_NAMED ? 0.55 : 1;
      const points = [];
      for (let i = 0; i < run.time.length; i++) points.push([x(run.time[i]), y(values[i * columns + k])]);
      polyline(pen, points.map(([a, b]) => (Number.isFinite(b) ? [a, b] : [NaN, NaN])));
    }
  });
  pen.restore();
  drawReleases(pen, shown, x, height, theme);
  pen.strokeStyle = theme.ink;
  polyline(pen, [[x(time), MARGINS.top], [x(time), height - MARGINS.bottom]]);
}

// Draws thin lines where tethers are released, with their numbers above.
function drawReleases(pen, runs, x, height, theme) {
  pen.strokeStyle = pen.fillStyle = theme.soft;
  const marks = new Map();
  for (const run of runs)
    run.released.forEach((frame, k) => {
      if (frame === null) return;
      const time = run.time[frame];
      marks.set(time, (marks.get(time) || new Set()).add(k + 1));
    });
  pen.setLineDash([1, 3]);
  const texts = [...marks].sort((a, b) => a[0] - b[0]).map(([time, tethers]) => {
    polyline(pen, [[x(time), MARGINS.top], [x(time), height - MARGINS.bottom]]);
    const numbers = [...tethers].join(", ");
    return [x(time), [`release of tether ${numbers}`, numbers]];
  });
  pen.setLineDash([]);
  pen.textAlign = "left";
  const right = pen.canvas.clientWidth - MARGINS.right;
  for (const [start, text] of placedTexts(texts, right, (text) => pen.measureText(text).width))
    pen.fillText(text, start, 11);
}

// The values of a signal but those of released tethers.
function heldValues(run, signal) {
  if (signal.axis !== "tether" || run.released.every((frame) => frame === null)) return signal.values;
  return signal.values.filter((_, i) => isHeld(run, signal, Math.floor(i / signal.width), i % signal.width));
}

function isHeld(run, signal, frame, k) {
  return signal.axis !== "tether" || run.released[k] === null || frame < run.released[k];
}

function padded([low, high]) {
  const room = high > low ? 0.06 * (high - low) : 0.5 * Math.abs(high) || 1;
  return [low - room, high + room];
}

// The values of an observable at a saved instant in words: all components, or their extremes.
function inWords(run, signal, frame) {
  const values = row(signal.values, frame, signal.width);
  if (signal.width === 1) return `${digits(values[0])} ${signal.unit}`;
  if (signal.width <= MOST_NAMED)
    return signal.labels.map((label, k) => `${label} ${digits(values[k])}`).join(", ") + ` ${signal.unit}`;
  const held = values.filter((_, k) => isHeld(run, signal, frame, k));
  const [low, high] = rangeOf(held);
  const which = held.length === values.length ? "all" : "attached";
  return `${signal.labels[0]}: ${digits(values[0])}; ${which}: ${digits(low)} to ${digits(high)} ${signal.unit}`;
}
