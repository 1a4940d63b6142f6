// Drawing of one moment of a run on a canvas.

const RING = 96; // sides of the polygon that stands for a circle
const ARROW = 0.62; // length of the arrow of the wind, in radii of the picture

// Unpacks a run of the page's data.
function unpacked(run) {
  const arrays = {};
  for (const name of ["time", "vertices", "straight", "rotation", "wind", "frames"])
    arrays[name] = run[name] === null ? null : decode(run[name]);
  const series = (found) =>
    Object.fromEntries(
      Object.entries(found).map(([name, entry]) => [
        name, { ...entry, width: entry.values.shape[1], values: decode(entry.values) },
      ])
    );
  return { ...run, ...arrays, colours: series(run.colours), signals: series(run.signals) };
}

function row(numbers, index, width) {
  return numbers.subarray(index * width, (index + 1) * width);
}

// Rotation from the axes of the vertices to those of the camera, and that of inertial vectors.
function orientations(run, frame, state) {
  const camera = product(turn(state.yaw, state.pitch), run.basis);
  if (run.rotation === null) return { body: camera, inertial: camera };
  const shown = state.axes === "inertial" ? row(run.rotation, frame, 9) : row(run.rotation, 0, 9);
  const body = product(camera, shown);
  return { body, inertial: product(body, transposed(row(run.rotation, frame, 9))) };
}

// Fits a canvas to its size on the page and clears it.
function cleared(canvas) {
  const ratio = window.devicePixelRatio || 1;
  const [width, height] = [canvas.clientWidth, canvas.clientHeight];
  if (canvas.width !== Math.round(width * ratio) || canvas.height !== Math.round(height * ratio)) {
    canvas.width = Math.round(width * ratio);
    canvas.height = Math.round(height * ratio);
  }
  const pen = canvas.getContext("2d");
  pen.setTransform(ratio, 0, 0, ratio, 0, 0);
  pen.clearRect(0, 0, width, height);
  return { pen, width, height };
}

function polyline(pen, points) {
  pen.beginPath();
  let down = false;
  for (const [x, y] of points) {
    if (!Number.isFinite(x)) down = false;
    else if (down) pen.lineTo(x, y);
    else pen.moveTo(x, y);
    down = Number.isFinite(x);
  }
  pen.stroke();
}

function arrow(pen, from, to) {
  polyline(pen, [from, to]);
  const angle = Math.atan2(to[1] - from[1], to[0] - from[0]);
  const barb = (side) => [to[0] - 9 * Math.cos(angle + side), to[1] - 9 * Math.sin(angle + side)];
  polyline(pen, [barb(0.4), to, barb(-0.4)]);
}

// Draws a run at one saved instant. range: of the colours; theme: colours of the page.
function drawPicture(canvas, run, frame, state, range, theme) {
  const { pen, width, height } = cleared(canvas);
  const camera = { radius: run.radius, width, height, zoom: state.zoom };
  const { body, inertial } = orientations(run, frame, state);
  const count = run.straight.length / 3;
  const vertices = row(run.vertices, frame, 3 * count);
  const place = (p) => project(applied(body, p.map((x, k) => x - run.middle[k])), camera);
  pen.lineCap = pen.lineJoin = "round";
  if (run.reach !== null) drawReference(pen, run, place, theme);
  const pixels = [];
  for (let v = 0; v < count; v++) {
    const p = Array.from(row(vertices, v, 3));
    pixels.push(place(exaggerated(p, row(run.straight, v, 3), state.exaggeration)));
  }
  const colours = run.colours[state.colour];
  const colour = (line) => {
    const value = colours ? colours.values[frame * colours.width + line] : NaN;
    const [r, g, b] = colourOf(value, range[0], range[1], theme.stops, theme.none);
    return `rgb(${r} ${g} ${b})`;
  };
  const endOf = (line) => (line === undefined ? NaN : line[line.length - 1]);
  const depth = run.lines.map((line) => pixels[endOf(line)][2]);
  const order = run.lines.map((_, k) => k).sort((a, b) => depth[a] - depth[b]);
  for (const k of order) {
    pen.strokeStyle = pen.fillStyle = colour(k);
    pen.lineWidth = 2.2 * Math.pow(depth[k] || 1, 2);
    polyline(pen, run.lines[k].map((v) => pixels[v]));
  }
  run.markers.forEach((v, k) => {
    const [x, y, size] = pixels[v];
    if (!Number.isFinite(x)) return;
    pen.fillStyle = endOf(run.lines[k]) === v ? colour(k) : theme.ink;
    pen.beginPath();
    pen.arc(x, y, 3.4 * size, 0, 2 * Math.PI);
    pen.fill();
  });
  if (run.wind !== null) {
    const tip = Array.from(row(run.wind, frame, 3)).map((x) => ARROW * run.radius * x);
    const [from, to] = [[0, 0, 0], tip].map((p) => project(applied(inertial, p), camera));
    pen.strokeStyle = pen.fillStyle = theme.wind;
    pen.lineWidth = 1.6;
    arrow(pen, from, to);
    pen.textAlign = to[0] < from[0] ? "left" : "right";
    pen.fillText("solar wind", to[0], to[1] + 18);
  }
  if (run.anchor !== null) {
    const [x, y] = place(run.anchor);
    pen.fillStyle = theme.ink;
    pen.fillRect(x - 4, y - 4, 8, 8);
  }
}

// Draws what does not deform: the circle of the undeformed tips in the spin plane, and the spin axis.
function drawReference(pen, run, place, theme) {
  pen.strokeStyle = theme.faint;
  pen.lineWidth = 1;
  const circle = [];
  for (let k = 0; k <= RING; k++) {
    const angle = (2 * Math.PI * k) / RING;
    circle.push(place([0, run.reach * Math.cos(angle), run.reach * Math.sin(angle)]));
  }
  polyline(pen, circle);
  pen.setLineDash([4, 4]);
  polyline(pen, [place([-0.35 * run.reach, 0, 0]), place([0.35 * run.reach, 0, 0])]);
  pen.setLineDash([]);
}
