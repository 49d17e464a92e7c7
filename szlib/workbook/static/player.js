// Replaces the picture of a finished run by a player: play and pause, a slider for the time, the playback speed.
function play(figure, run) {
  figure.dataset.ready = "";
  figure.style.margin = "0";
  const { layout, snapshots } = run, last = snapshots.length - 1;
  figure.textContent = "";
  const width = Math.max(200, Math.min(figure.clientWidth || 640, 640));
  const [x0, x1, y0, y1] = layout.limits;
  const axis = 26;  // room for the numbers, which walls would cross inside the scene [pixels]
  const height = Math.round(Math.min(420, ((width - 2 * axis) * (y1 - y0)) / (x1 - x0)) + axis);
  const sceneCanvas = addElement(figure, "canvas", { role: "img", ariaLabel: run.alt });
  const chartCanvas = addElement(figure, "canvas", { role: "img", ariaLabel: "the least h over time" }, { display: "block", marginTop: "6px" });
  const scene = prepareCanvas(sceneCanvas, width, height), chart = prepareCanvas(chartCanvas, width, 100);
  const bar = addElement(figure, "div", {}, { display: "flex", gap: "8px", alignItems: "center", maxWidth: `${width}px` });
  const button = addElement(bar, "button", { type: "button" });
  const slider = addElement(bar, "input", { type: "range", min: 0, max: last, value: 0, ariaLabel: "time" }, { flex: "1" });
  const pace = addElement(bar, "select", { ariaLabel: "playback speed" });
  for (const factor of [1, 2, 4]) addElement(pace, "option", { value: factor, textContent: `${factor}\u00d7`, selected: factor === 2 });
  const status = addElement(figure, "div", {}, { fontSize: "12px", fontVariantNumeric: "tabular-nums" });
  addLegend(figure, layout.colours);
  const view = makeView(layout.limits, width, height, axis);
  const times = snapshots.map((s) => s.t), values = snapshots.map((s) => s.h);
  let started = null;

  const show = () => {
    const row = Number(slider.value), snapshot = snapshots[row];
    drawScene(scene, view, layout, snapshot, snapshots.slice(0, row + 1).map((s) => s.robot));
    drawBarriers(chart, width, 100, times, values, snapshot.t, [0, times[last]], layout.colours);
    const h = snapshot.h === null ? "" : `, least h ${snapshot.h.toFixed(2)} m`;
    const plan = !["", "optimal"].includes(snapshot.status) ? `, plan: ${snapshot.status}` : "";
    const stuck = snapshot.stuck ? `, no progress for ${snapshot.stuck.toFixed(1)} s` : "";
    status.textContent = `t = ${snapshot.t.toFixed(1)} s, speed ${snapshot.speed.toFixed(2)} m/s${h}${plan}${stuck}`;
  };
  const tick = (now) => {
    if (started === null || !figure.isConnected) return;
    const row = started.row + Math.floor(((now - started.time) / 1000 / layout.dt) * Number(pace.value));
    slider.value = Math.min(row, last);
    show();
    if (row >= last) stop();
    else requestAnimationFrame(tick);
  };
  const start = () => {
    if (Number(slider.value) >= last) slider.value = 0;
    started = { time: performance.now(), row: Number(slider.value) };
    button.textContent = "\u275a\u275a pause";
    requestAnimationFrame(tick);
  };
  const stop = () => {
    started = null;
    button.textContent = "\u25b6 play";
  };
  button.onclick = () => (started ? stop() : start());
  slider.oninput = () => { stop(); show(); };
  pace.onchange = () => { if (started) start(); };
  stop();
  slider.value = Math.floor(last / 3);
  show();
}
