// A recorded laboratory: runs over a small grid of values, chosen by sliders; no kernel and no network.
//
// data      {layout, axes: [{name, label, values}], runs: [...], texts: [...]}; a run has rows
//           [robot, speed, people, h, plan, control, allowed, active, sentence, safety], in cm, and the numbers of texts

async function unpackRecording(text) {
  const bytes = Uint8Array.from(atob(text), (character) => character.charCodeAt(0));
  const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("deflate"));
  return JSON.parse(await new Response(stream).text());
}

const inMetres = (values) => values.map((value) => value / 100);
const inPairs = (values) => values.flatMap((value, i) => (i % 2 ? [] : [[value / 100, values[i + 1] / 100]]));

function readRow(data, run, k) {
  const [robot, speed, people, h, plan, control, allowed, active, sentence, safety] = run.rows[k];
  const poses = people.map(inMetres);
  const zones = poses.map(([x, y, angle], i) => {
    const [cx, cy, a, b, turn] = data.zones[i] ?? data.zones[0], [cos, sin] = [Math.cos(angle), Math.sin(angle)];
    return [x + cos * cx - sin * cy, y + sin * cx + cos * cy, a, b, angle + turn];
  });
  return {
    t: k * data.layout.dt * data.every, robot: inMetres(robot), speed: speed / 100, people: poses, zones, plan: inPairs(plan),
    h: h === null ? null : h / 100, control: inMetres(control), allowed: allowed.map(inPairs), a_max: data.a_max,
    active: active.map(([kind, number, curve]) => ({ kind, number, curve: inPairs(curve) })),
    sentence: data.texts[sentence], safety: data.texts[safety],
  };
}

async function playRecording(figure, text) {
  figure.dataset.ready = "";
  const data = await unpackRecording(text), { layout, axes } = data;
  figure.querySelector(".szlib-still")?.remove();
  const page = addElement(figure, "div", { className: "szlib-recorded", tabIndex: 0, role: "group", ariaLabel: data.title }, { outlineOffset: "2px" });
  figure.prepend(page);
  const width = Math.max(240, Math.min(page.clientWidth || 600, 600)), [x0, x1, y0, y1] = layout.limits;
  const height = Math.round(Math.max(170, Math.min(360, (width * (y1 - y0)) / (x1 - x0))));
  const choices = addElement(page, "div", {}, { display: "flex", flexWrap: "wrap", gap: "4px 18px", fontSize: "13px", marginBottom: "4px" });
  const inputs = axes.map(({ name, label, values, start }) => {
    const row = addElement(choices, "label", {}, { display: "flex", gap: "6px", alignItems: "center" });
    addElement(row, "span", { textContent: label });
    const input = addElement(row, "input", { type: "range", min: 0, max: values.length - 1, step: 1, value: start, ariaLabel: label, className: `szlib-axis-${name}` }, { width: "110px" });
    const shown = addElement(row, "output", {}, { minWidth: "3em", fontWeight: "bold" });
    const name_value = () => { shown.textContent = `${values[input.value]}`; input.ariaValueText = `${values[input.value]}`; };
    input.addEventListener("input", name_value);
    name_value();
    return input;
  });
  const main = addElement(page, "div", {}, { display: "flex", flexWrap: "wrap", gap: "10px", alignItems: "flex-start" });
  const left = addElement(main, "div", {}, { width: `${width}px`, maxWidth: "100%" }), right = addElement(main, "div", {}, { width: "240px", fontSize: "13px" });
  const sceneCanvas = addElement(left, "canvas", { role: "img", className: "szlib-recorded-scene" }, { display: "block" });
  const bar = addElement(left, "div", {}, { display: "flex", gap: "6px", alignItems: "center" });
  const button = addElement(bar, "button", { type: "button", className: "szlib-recorded-play" });
  const back = addElement(bar, "button", { type: "button", textContent: "\u25c2", ariaLabel: "one step back", className: "szlib-recorded-back" });
  const next = addElement(bar, "button", { type: "button", textContent: "\u25b8", ariaLabel: "one step", className: "szlib-recorded-step" });
  const time = addElement(bar, "input", { type: "range", min: 0, step: 1, value: 0, ariaLabel: "time", className: "szlib-recorded-time" }, { flex: "1", minWidth: "60px" });
  const pace = addElement(bar, "select", { ariaLabel: "playback speed" });
  for (const factor of [1, 2, 4]) addElement(pace, "option", { value: factor, textContent: `${factor}\u00d7`, selected: factor === 2 });
  const chartCanvas = addElement(left, "canvas", { role: "img", ariaLabel: "the least h over time" }, { display: "block", marginTop: "4px" });
  const status = addElement(left, "div", { className: "szlib-recorded-status" }, { fontSize: "12px", fontVariantNumeric: "tabular-nums" });
  addElement(right, "strong", { textContent: "Why did it do this?" });
  const why = addElement(right, "div", { className: "szlib-recorded-why", role: "status" }, { minHeight: "5.4em" });
  const safety = addElement(right, "div", {}, { fontWeight: "bold", margin: "2px 0" });
  const controlsCanvas = addElement(right, "canvas", { role: "img", ariaLabel: "admissible accelerations, and the chosen one" });
  addLegend(page, layout.colours, [["\u25a0", "#99d8c7", "admissible accelerations"], ["\u2501", ACTIVE, "active limit"], ["\u25c6", layout.colours.robot, "chosen acceleration"]]);
  addElement(page, "div", { textContent: "Keys: space plays, \u2190 and \u2192 step. Recorded: no kernel is needed." }, { fontSize: "12px", color: "#555555" });
  const scene = prepareCanvas(sceneCanvas, width, height), chart = prepareCanvas(chartCanvas, width, 100), polygon = prepareCanvas(controlsCanvas, 230, 230);
  const view = makeView(layout.limits, width, height);
  let started = null, run = null, rows = [];

  const show = () => {
    const k = Math.min(Number(time.value), rows.length - 1), row = rows[k], times = rows.map((each) => each.t), end = times[rows.length - 1];
    drawScene(scene, view, { ...layout, walls: run.walls, goal: run.goal }, row, rows.slice(0, k + 1).map((each) => each.robot));
    drawBarriers(chart, width, 100, times, rows.map((each) => each.h), row.t, [0, end], layout.colours);
    drawAccelerations(polygon, 230, row, layout.colours);
    const h = row.h === null ? "" : `, least h ${row.h.toFixed(2)} m`;
    status.textContent = `t = ${row.t.toFixed(1)} s, speed ${row.speed.toFixed(2)} m/s${h}. ${run.summary}`;
    sceneCanvas.ariaLabel = `${data.title}: ${status.textContent} ${row.sentence}`;
    if (why.textContent !== row.sentence) why.textContent = row.sentence;
    safety.textContent = row.safety;
    safety.style.color = row.safety.startsWith("Safe") ? "#00664d" : "#a00000";
    time.ariaValueText = `${row.t.toFixed(1)} s`;
  };
  const choose = () => {
    const number = inputs.reduce((sum, input, i) => sum * axes[i].values.length + Number(input.value), 0);
    run = data.runs[number];
    rows = run.rows.map((_, k) => readRow(data, run, k));
    time.max = rows.length - 1;
    show();
  };
  const stop = () => { started = null; button.textContent = "\u25b6 play"; };
  const tick = (now) => {
    if (started === null || !page.isConnected) return;
    const k = started.k + Math.floor(((now - started.time) / 1000 / (layout.dt * data.every)) * Number(pace.value));
    time.value = Math.min(k, rows.length - 1);
    show();
    if (k >= rows.length - 1) stop(); else requestAnimationFrame(tick);
  };
  const start = () => {
    if (Number(time.value) >= rows.length - 1) time.value = 0;
    started = { time: performance.now(), k: Number(time.value) };
    button.textContent = "\u275a\u275a pause";
    requestAnimationFrame(tick);
  };
  const move = (by) => { stop(); time.value = Number(time.value) + by; show(); };
  button.onclick = () => (started ? stop() : start());
  back.onclick = () => move(-1);
  next.onclick = () => move(1);
  time.oninput = () => { stop(); show(); };
  pace.onchange = () => { if (started) start(); };
  for (const input of inputs) input.addEventListener("input", () => { choose(); if (started) start(); });
  page.onkeydown = (event) => {
    if (event.target !== page) return;
    const action = { " ": () => button.onclick(), ArrowRight: () => move(1), ArrowLeft: () => move(-1) }[event.key];
    if (action) { event.preventDefault(); event.stopPropagation(); action(); }
  };
  page.dataset.lmSuppressShortcuts = "true";
  stop();
  choose();
}
