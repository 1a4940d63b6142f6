// The page: its state, its controls, and what they redraw.

const data = JSON.parse(document.getElementById("data").textContent);
const runs = data.runs.map(unpacked);
const clock = runs.reduce((a, b) => (b.time[b.time.length - 1] > a.time[a.time.length - 1] ? b : a));
const end = clock.time[clock.time.length - 1];
const WHOLE = 30; // seconds in which the whole run is played at speed 1

const state = { ...data.start, frame: 0, zoom: 1, playing: false, speed: 1, locked: true };
const home = { yaw: state.yaw, pitch: state.pitch, zoom: 1 };
const at = (id) => document.getElementById(id);
const dark = window.matchMedia("(prefers-color-scheme: dark)");
let played = 0; // time [s] of the moment that is played

function theme() {
  const style = getComputedStyle(document.documentElement);
  const colour = (name) => style.getPropertyValue(`--${name}`).trim();
  const curves = ["a", "b", "c"].map((letter) => colour(`curve-${letter}`));
  return { ink: colour("ink"), soft: colour("soft"), faint: colour("faint"), wind: colour("wind"), curves,
    stops: data.stops, none: data.none };
}

// Range of the colours: of all instants of all runs if it is locked, otherwise of this one.
function colourRange(frames) {
  const name = state.colour;
  const values = runs.map((run, k) => {
    const found = run.colours[name];
    if (!found) return [];
    return rangeOf(state.locked ? found.values : row(found.values, frames[k], found.width));
  });
  const [low, high] = rangeOf(values.flat());
  return high - low <= data.equal * Math.max(Math.abs(low), Math.abs(high)) ? [low, low] : [low, high];
}

function draw() {
  const time = clock.time[state.frame];
  const frames = runs.map((run) => nearest(run.time, time));
  const range = colourRange(frames);
  const colours = theme();
  runs.forEach((run, k) => {
    const canvas = at(`picture-${k}`);
    canvas.getContext("2d").font = "12px system-ui, sans-serif";
    drawPicture(canvas, run, frames[k], state, range, colours);
  });
  at("time").textContent = `${Number(time.toPrecision(6))} s`;
  at("turns").textContent = clock.period ? `${(time / clock.period).toFixed(3)} spin periods` : "";
  at("statement").textContent =
    (state.exaggeration === 1 ? "true shape" : `lateral displacements \u00d7 ${digits(state.exaggeration)}`) +
    (clock.rotation ? `, ${state.axes} axes, centred on the hub` : "");
  drawKey(range);
  for (const id of ["first", "second"]) {
    const name = at(`${id}-name`).value;
    drawPlot(at(`${id}-plot`), runs, name, time, colours);
    at(`${id}-value`).replaceChildren(...runs.map((run, k) => valueOf(run, k, name, frames[k])));
  }
}

// The line of a plot that tells the values of a run.
function valueOf(run, k, name, frame) {
  const line = document.createElement("div");
  const value = run.signals[name] ? inWords(run, run.signals[name], frame) : "not in this file";
  line.textContent = runs.length === 1 ? value : `${run.title} (${DASH_NAMES[k % DASHES.length]}): ${value}`;
  return line;
}

// The key of the colours, a gradient between the ends of the range.
function drawKey(range) {
  const found = runs.map((run) => run.colours[state.colour]).find((entry) => entry);
  at("key").hidden = !found;
  if (!found) return;
  at("low").textContent = digits(range[0]);
  at("high").textContent = `${digits(range[1])} ${found.unit === "-" ? "" : found.unit}`;
  at("quantity").textContent = found.label;
  at("gradient").style.background =
    range[1] > range[0] ? `linear-gradient(to right, ${data.stops.join(", ")})`
      : `rgb(${colourOf(range[0], range[0], range[1], data.stops, data.none).join(" ")})`;
}

function show(frame) {
  state.frame = Math.min(Math.max(frame, 0), clock.time.length - 1);
  at("slider").value = state.frame;
  requestAnimationFrame(draw);
}

function play(now, before) {
  if (!state.playing) return;
  played += ((now - before) / 1000) * state.speed * (end / WHOLE);
  if (played > end) played = 0;
  state.frame = nearest(clock.time, played);
  at("slider").value = state.frame;
  draw();
  requestAnimationFrame((next) => play(next, now));
}

function setPlaying(playing) {
  state.playing = playing;
  at("play").textContent = playing ? "Pause" : "Play";
  at("play").setAttribute("aria-pressed", playing);
  if (playing) {
    played = state.frame === clock.time.length - 1 ? 0 : clock.time[state.frame];
    requestAnimationFrame((now) => play(now, now));
  }
}

function options(select, entries, chosen) {
  for (const [value, text] of entries) {
    const option = document.createElement("option");
    option.value = value;
    option.textContent = text;
    select.append(option);
  }
  if (entries.some(([value]) => value === chosen)) select.value = chosen;
}

function names(part) {
  return [...new Set(runs.flatMap((run) => Object.keys(run[part])))];
}

function makePictures() {
  runs.forEach((run, k) => {
    const figure = document.createElement("figure");
    const [canvas, caption] = [document.createElement("canvas"), document.createElement("figcaption")];
    canvas.id = `picture-${k}`;
    canvas.setAttribute("role", "img");
    canvas.setAttribute("aria-label", `${run.title} in motion`);
    const [title, about] = [document.createElement("strong"), document.createElement("span")];
    title.textContent = run.title;
    const shown = run.frames.length === run.saved ? `${run.saved} saved instants`
      : `${run.frames.length} of ${run.saved} saved instants`;
    about.textContent = [run.model, ...run.remarks, shown].join("; ");
    caption.append(title, about);
    figure.append(canvas, caption);
    at("pictures").append(figure);
    turnable(canvas);
  });
}

// Drag turns all pictures, the wheel enlarges them, a double click brings the first view back.
function turnable(canvas) {
  let last = null;
  canvas.addEventListener("pointerdown", (event) => {
    last = [event.clientX, event.clientY];
    canvas.setPointerCapture(event.pointerId);
  });
  canvas.addEventListener("pointermove", (event) => {
    if (last === null) return;
    state.yaw += 0.008 * (event.clientX - last[0]);
    state.pitch = Math.min(Math.max(state.pitch + 0.008 * (event.clientY - last[1]), -1.57), 1.57);
    last = [event.clientX, event.clientY];
    draw();
  });
  for (const name of ["pointerup", "pointercancel"]) canvas.addEventListener(name, () => (last = null));
  canvas.addEventListener("wheel", (event) => {
    event.preventDefault();
    state.zoom = Math.min(Math.max(state.zoom * Math.exp(-0.0012 * event.deltaY), 0.1), 50);
    draw();
  }, { passive: false });
  canvas.addEventListener("dblclick", () => { Object.assign(state, home); draw(); });
}

function makeControls() {
  const slider = at("slider");
  slider.max = clock.time.length - 1;
  slider.addEventListener("input", () => { setPlaying(false); show(Number(slider.value)); });
  at("play").addEventListener("click", () => setPlaying(!state.playing));
  const speeds = [0.1, 0.25, 0.5, 1, 2, 4].map((s) => [String(s), `${Number(((s * end) / WHOLE).toPrecision(2))} \u00d7 real time`]);
  options(at("speed"), speeds, "1");
  at("speed").addEventListener("change", () => (state.speed = Number(at("speed").value)));
  at("axes-choice").hidden = !clock.rotation;
  options(at("axes"), [["inertial", "inertial"], ["spinning", "spinning"]], state.axes);
  options(at("colour"), [...names("colours").map((name) => [name, name]), ["none", "none"]], state.colour);
  for (const name of ["axes", "colour"])
    at(name).addEventListener("change", () => { state[name] = at(name).value; draw(); });
  const factors = [...new Set([1, 2, 5, 10, 20, 50, 100, 200, 500, 1000, state.exaggeration])];
  options(at("exaggeration"), factors.sort((a, b) => a - b).map((x) => [String(x), `\u00d7 ${digits(x)}`]),
    String(state.exaggeration));
  at("exaggeration").addEventListener("change", () => {
    state.exaggeration = Number(at("exaggeration").value);
    draw();
  });
  at("locked").addEventListener("change", () => { state.locked = at("locked").checked; draw(); });
  const signals = names("signals").map((name) => [name, name]);
  for (const [k, id] of ["first", "second"].entries()) {
    options(at(`${id}-name`), signals, data.plots[k]);
    at(`${id}-name`).addEventListener("change", draw);
  }
}

makePictures();
makeControls();
new ResizeObserver(draw).observe(document.body);
dark.addEventListener("change", draw);
show(0);
