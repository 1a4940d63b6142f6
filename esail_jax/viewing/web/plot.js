// A small plot of an observable against time, with a cursor.

const MARGINS = { left: 64, right: 10, top: 8, bottom: 20 };
const MOST_NAMED = 3; // components that are told one by one
const DASHES = [[], [6, 3], [2, 2]]; // of the runs
const DASH_NAMES = ["solid", "dashed", "dotted"];

// Draws an observable of several runs and a cursor at `time`.
function drawPlot(canvas, runs, name, time, theme) {
  const { pen, width, height } = cleared(canvas);
  const shown = runs.filter((run) => run.signals[name]);
  if (!shown.length) return;
  const [low, high] = padded(rangeOf(shown.map((run) => rangeOf(run.signals[name].values)).flat()));
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
  pen.textAlign = "left";
  pen.fillText("0", x(0), height - 5);
  pen.textAlign = "right";
  pen.fillText(`${digits(end)} s`, x(end), height - 5);
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
  pen.globalAlpha = 1;
  pen.setLineDash([]);
  pen.strokeStyle = theme.ink;
  polyline(pen, [[x(time), MARGINS.top], [x(time), height - MARGINS.bottom]]);
}

function padded([low, high]) {
  const room = high > low ? 0.06 * (high - low) : 0.5 * Math.abs(high) || 1;
  return [low - room, high + room];
}

// The values of an observable at a saved instant in words: all components, or their extremes.
function inWords(signal, frame) {
  const values = row(signal.values, frame, signal.width);
  if (signal.width === 1) return `${digits(values[0])} ${signal.unit}`;
  if (signal.width <= MOST_NAMED)
    return signal.labels.map((label, k) => `${label} ${digits(values[k])}`).join(", ") + ` ${signal.unit}`;
  const [low, high] = rangeOf(values);
  return `${signal.labels[0]} ${digits(values[0])}; all ${digits(low)} to ${digits(high)} ${signal.unit}`;
}
