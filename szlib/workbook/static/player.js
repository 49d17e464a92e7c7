// Plays a finished run in place of its picture: play and pause, a slider for the time, the pace.
function play(figure, run) {
  figure.dataset.ready = "";
  figure.style.margin = "0";
  const { stage, moments } = run, last = moments.length - 1;
  figure.textContent = "";
  const width = Math.max(280, Math.min(figure.clientWidth || 640, 640));
  const [x0, x1, y0, y1] = stage.limits;
  const height = Math.round(Math.min(420, (width * (y1 - y0)) / (x1 - x0)));
  const canvas = element(figure, "canvas", { role: "img", ariaLabel: run.alt });
  const chart = element(figure, "canvas", { role: "img", ariaLabel: "the least h over time" }, { display: "block", marginTop: "6px" });
  const on = surface(canvas, width, height), below = surface(chart, width, 100);
  const bar = element(figure, "div", {}, { display: "flex", gap: "8px", alignItems: "center", maxWidth: `${width}px` });
  const button = element(bar, "button", { type: "button" });
  const slider = element(bar, "input", { type: "range", min: 0, max: last, value: 0, ariaLabel: "time" }, { flex: "1" });
  const pace = element(bar, "select", { ariaLabel: "pace" });
  for (const times of [1, 2, 4]) element(pace, "option", { value: times, textContent: `${times}\u00d7`, selected: times === 2 });
  const told = element(figure, "div", {}, { fontSize: "12px", fontVariantNumeric: "tabular-nums" });
  legend(figure, stage.colours);
  const at = view(stage.limits, width, height);
  const times = moments.map((m) => m.t), values = moments.map((m) => m.h);
  let begun = null;

  const show = () => {
    const row = Number(slider.value), moment = moments[row];
    scene(on, at, stage, moment, moments.slice(0, row + 1).map((m) => m.robot));
    barriers(below, width, 100, times, values, moment.t, [0, times[last]], stage.colours);
    const h = moment.h === null ? "" : `, least h ${moment.h.toFixed(2)} m`;
    told.textContent = `t = ${moment.t.toFixed(1)} s, ${moment.speed.toFixed(2)} m/s${h}${moment.rung ? `, ${moment.rung}` : ""}`;
  };
  const tick = (now) => {
    if (begun === null || !figure.isConnected) return;
    const row = begun.row + Math.floor(((now - begun.time) / 1000 / stage.dt) * Number(pace.value));
    slider.value = Math.min(row, last);
    show();
    if (row >= last) stop();
    else requestAnimationFrame(tick);
  };
  const start = () => {
    if (Number(slider.value) >= last) slider.value = 0;
    begun = { time: performance.now(), row: Number(slider.value) };
    button.textContent = "\u275a\u275a pause";
    requestAnimationFrame(tick);
  };
  const stop = () => {
    begun = null;
    button.textContent = "\u25b6 play";
  };
  button.onclick = () => (begun ? stop() : start());
  slider.oninput = () => { stop(); show(); };
  pace.onchange = () => { if (begun) start(); };
  stop();
  slider.value = Math.floor(last / 3);
  show();
}
