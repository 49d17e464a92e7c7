// The laboratory: a panel for each robot, side by side, that a user drags and sets while it runs.
// The kernel computes each step; this page asks for the next step when the last one has arrived.

const GRAB_RADIUS = 16;  // distance within which the pointer takes hold of a thing [pixels]

// The sliders of each robot: one for each field of `RobotOptions` that is a number.
const SLIDERS = [
  { name: "gamma", label: "gamma", low: 0.01, high: 1.0, step: 0.01 },
  { name: "N_h", label: "N_h [steps]", low: 1, high: 24, step: 1 },
  { name: "a_max", label: "a_max [m/s\u00b2]", low: 0.2, high: 3.0, step: 0.1 },
  { name: "size", label: "size of the zone [times]", low: 0.3, high: 2.0, step: 0.05 },
];
const SPEED_SLIDER = { name: "speed", label: "speed of the person [m/s]", low: 0.0, high: 2.0, step: 0.05 };

// The snapshot between two snapshots: `share` of the way from `before` to `now`.
function interpolate(before, now, share) {
  const mix = (a, b) => (a && b && a.length === b.length ? b.map((v, i) => a[i] + share * (v - a[i])) : b);
  const moved = (a, b) => mix(a, b).concat();
  const zones = now.zones.map((zone, i) => [...moved(before.zones[i]?.slice(0, 2), zone.slice(0, 2)), ...zone.slice(2)]);
  const people = now.people.map((p, i) => [...moved(before.people[i]?.slice(0, 2), p.slice(0, 2)), ...p.slice(2)]);
  return { ...now, robot: mix(before.robot, now.robot), zones, people };
}

// Draws the allowed accelerations, and the chosen one.
function drawAccelerations(context, size, snapshot, colours) {
  const a = snapshot.a_max, reach = 1.2 * a, view = makeView([-reach, reach, -reach, reach], size, size);
  context.clearRect(0, 0, size, size);
  context.fillStyle = "white";
  context.fillRect(0, 0, size, size);
  drawLine(context, view, [[-a, -a], [a, -a], [a, a], [-a, a], [-a, -a]], "#555555", 1, [4, 3]);
  drawLine(context, view, [[-reach, 0], [reach, 0]], "#cccccc", 1);
  drawLine(context, view, [[0, -reach], [0, reach]], "#cccccc", 1);
  for (const ring of snapshot.allowed) {
    context.beginPath();
    for (const [x, y] of ring) context.lineTo(...view.pixel(x, y));
    context.closePath();
    context.fillStyle = `${colours.plan}55`;
    context.fill();
    context.strokeStyle = colours.plan;
    context.lineWidth = 1.5;
    context.stroke();
  }
  drawDiamond(context, view.pixel(...snapshot.control), 5, colours.robot);
  context.fillStyle = "#555555";
  context.font = "11px sans-serif";
  context.fillText(`\u00b1${a.toFixed(1)} m/s\u00b2`, 3, 11);
}

// Adds the panel of one robot: its canvases, its status, its sliders. `configure` sends a changed option.
function addPanel(parent, index, content, configure) {
  const { layout } = content, width = 430, [x0, x1, y0, y1] = layout.limits;
  const height = Math.round(Math.max(180, Math.min(400, (width * (y1 - y0)) / (x1 - x0))));
  const box = addElement(parent, "div", { className: "szlib-panel" }, { width: `${width}px` });
  const name = String.fromCharCode(65 + index);
  addElement(box, "strong", { textContent: `Robot ${name}` });
  const canvas = addElement(box, "canvas", { role: "img", ariaLabel: `scene of robot ${name}` }, { display: "block", touchAction: "none" });
  const row = addElement(box, "div", {}, { display: "flex", gap: "4px", marginTop: "4px" });
  const chartCanvas = addElement(row, "canvas", { role: "img", ariaLabel: `the least h of robot ${name} over time` });
  const controlCanvas = addElement(row, "canvas", { role: "img", ariaLabel: `allowed accelerations of robot ${name}, and the chosen one` });
  const status = addElement(box, "div", { className: "szlib-status", role: "status" }, { fontSize: "12px", fontVariantNumeric: "tabular-nums", minHeight: "2.6em" });
  const scene = prepareCanvas(canvas, width, height), chart = prepareCanvas(chartCanvas, 310, 112), controls = prepareCanvas(controlCanvas, 112, 112);
  const panel = {
    view: makeView(layout.limits, width, height), canvas, snapshot: null, before: null, path: [], times: [], values: [],
    clear() { panel.path = []; panel.times = []; panel.values = []; panel.before = null; },
    add(snapshot) {
      panel.before = panel.snapshot;
      panel.snapshot = snapshot;
      if (panel.times.length && snapshot.t === panel.times[panel.times.length - 1]) return;
      panel.path.push(snapshot.robot);
      panel.times.push(snapshot.t);
      panel.values.push(snapshot.h);
    },
    draw(share) {
      const { snapshot, before, view } = panel;
      if (!snapshot) return;
      const shown = before && share < 1 ? interpolate(before, snapshot, share) : snapshot;
      drawScene(scene, view, layout, shown, [...panel.path.slice(0, -1), shown.robot]);
      for (const [xa, ya, xb, yb] of layout.walls) {
        for (const end of [[xa, ya], [xb, yb]]) {
          const [px, py] = view.pixel(...end);
          scene.strokeStyle = "black";
          scene.fillStyle = "white";
          scene.lineWidth = 1.5;
          scene.fillRect(px - 4, py - 4, 8, 8);
          scene.strokeRect(px - 4, py - 4, 8, 8);
        }
      }
      const now = snapshot.t, span = [Math.max(0, now - 20), Math.max(20, now)];
      drawBarriers(chart, 310, 112, panel.times, panel.values, now, span, layout.colours);
      drawAccelerations(controls, 112, snapshot, layout.colours);
      const h = snapshot.h === null ? "" : `, least h ${snapshot.h.toFixed(2)} m`;
      const safety = snapshot.safe ? "safe" : "NOT SAFE";
      const stuck = snapshot.stuck ? `, no progress for ${snapshot.stuck.toFixed(1)} s` : "";
      status.textContent = `t = ${now.toFixed(1)} s, speed ${snapshot.speed.toFixed(2)} m/s${h}, solver: ${snapshot.fallback}, ${safety}${stuck}`;
    },
  };
  for (const options of SLIDERS) addSlider(box, options, content.robots[index][options.name], (value) => configure(index, options.name, value));
  const label = addElement(box, "label", {}, { display: "flex", gap: "8px", fontSize: "12px" });
  addElement(label, "span", { textContent: "estimator" }, { width: "150px" });
  const select = addElement(label, "select", { ariaLabel: `estimator of robot ${name}` });
  for (const estimator of content.estimators) addElement(select, "option", { value: estimator, textContent: estimator, selected: estimator === content.robots[index].estimator });
  select.onchange = () => configure(index, "estimator", select.value);
  return panel;
}

function addSlider(parent, options, value, set) {
  const row = addElement(parent, "label", {}, { display: "flex", gap: "8px", alignItems: "center", fontSize: "12px" });
  addElement(row, "span", { textContent: options.label }, { width: "150px" });
  const range = { min: options.low, max: options.high, step: options.step };
  const input = addElement(row, "input", { type: "range", ...range, name: options.name }, { flex: "1" });
  input.value = value;
  const output = addElement(row, "output", { textContent: value }, { width: "40px", fontVariantNumeric: "tabular-nums" });
  input.oninput = () => {
    output.textContent = input.value;
    set(Number(input.value));
  };
}

// Returns what lies under the pointer, {kind, index, end}, or null.
function findHandle(panel, layout, [px, py]) {
  const found = [];
  const addIfNear = (x, y, handle) => {
    const [qx, qy] = panel.view.pixel(x, y), distance = Math.hypot(px - qx, py - qy);
    if (distance <= GRAB_RADIUS) found.push({ ...handle, distance });
  };
  panel.snapshot.people.forEach(([x, y], index) => addIfNear(x, y, { kind: "person", index }));
  addIfNear(...layout.goal, { kind: "goal" });
  layout.walls.forEach(([xa, ya, xb, yb], index) => {
    addIfNear(xa, ya, { kind: "wall", index, end: 0 });
    addIfNear(xb, yb, { kind: "wall", index, end: 2 });
  });
  return found.sort((a, b) => a.distance - b.distance)[0] || null;
}

function render({ model, el }) {
  const content = structuredClone(model.get("content")), { layout } = content;
  el.dataset.lmSuppressShortcuts = "true";  // keys move the slider that has the focus, not JupyterLab's cells
  let changes = {}, running = false, waiting = false, alive = true;
  let requested = 0, arrived = 0, counted = 0, frames = 0, steps = 0;  // times [ms], and counts since the last one

  const bar = addElement(el, "div", {}, { display: "flex", gap: "10px", alignItems: "center", flexWrap: "wrap", margin: "4px 0" });
  const runButton = addElement(bar, "button", { type: "button", className: "szlib-run" });
  const restartButton = addElement(bar, "button", { type: "button", textContent: "restart" });
  const pace = addElement(bar, "select", { ariaLabel: "playback speed" });
  for (const factor of [0.5, 1, 2, 4]) addElement(pace, "option", { value: factor, textContent: `${factor}\u00d7`, selected: factor === 2 });
  const speed = addElement(bar, "div", {}, { width: "330px" });
  addSlider(speed, SPEED_SLIDER, content.speed, (value) => { changes.speed = value; update(); });
  const shareButton = addElement(bar, "button", { type: "button", textContent: "share", className: "szlib-share" });
  const rate = addElement(bar, "span", { className: "szlib-rate" }, { fontSize: "12px" });
  const row = addElement(el, "div", {}, { display: "flex", gap: "14px", flexWrap: "wrap" });
  const configure = (index, name, value) => {
    changes.robots = { ...changes.robots, [index]: { ...changes.robots?.[index], [name]: value } };
    update();
  };
  const panels = content.robots.map((_, index) => addPanel(row, index, content, configure));
  addLegend(el, layout.colours);
  addElement(el, "div", { textContent: "Drag the person, the goal (\u25c6) or the ends of walls (\u25a1)." }, { fontSize: "12px" });
  const error = addElement(el, "div", { className: "szlib-error", role: "alert" }, { fontSize: "12px", color: "#a00000" });
  const cell = addElement(el, "textarea", { className: "szlib-cell", ariaLabel: "parameter cell", readOnly: true, rows: 12, hidden: true }, { width: "95%", fontFamily: "monospace" });

  const request = (kind) => {
    waiting = true;
    requested = performance.now();
    model.send({ kind, changes });
    changes = {};
  };
  const update = () => { if (!waiting && !running) request("decide"); };
  const drawFrame = (now) => {
    if (!alive) return;
    requestAnimationFrame(drawFrame);
    const period = (1000 * layout.dt) / Number(pace.value);
    if (running && !waiting && now - requested >= period - 8) request("step");
    else if (!running && !waiting && Object.keys(changes).length) request("decide");
    const share = running ? Math.min(1, (now - arrived) / period) : 1;
    panels.forEach((panel) => panel.draw(share));
    frames += 1;
    if (now - counted >= 1000) {
      const rates = [frames, steps].map((n) => ((1000 * n) / (now - counted)).toFixed(0));
      rate.textContent = running ? `${rates[0]} frames/s, ${rates[1]} steps/s` : "";
      [frames, steps, counted] = [0, 0, now];
    }
  };
  const receive = (message) => {
    if (message.kind === "snapshots") {
      waiting = false;
      error.textContent = "";
      arrived = performance.now();
      steps += 1;
      if (message.snapshots[0].t < (panels[0].snapshot?.t ?? 0)) panels.forEach((panel) => panel.clear());
      message.snapshots.forEach((snapshot, i) => panels[i].add(snapshot));
    } else if (message.kind === "error") {
      waiting = false;
      running = false;
      labelButton();
      error.textContent = message.text;
      Object.assign(layout, message.layout);
    } else if (message.kind === "cell") {
      cell.value = message.text;
      cell.hidden = false;
      cell.select();
    }
  };
  const labelButton = () => { runButton.textContent = running ? "\u275a\u275a pause" : "\u25b6 run"; };
  runButton.onclick = () => { running = !running; labelButton(); };
  restartButton.onclick = () => { changes.restart = true; if (!waiting) request("decide"); };
  shareButton.onclick = () => {
    model.send({ kind: "share", changes });
    changes = {};
  };

  panels.forEach((panel) => {
    let handle = null;
    const pointer = (event) => [event.offsetX, event.offsetY];
    panel.canvas.onpointerdown = (event) => {
      handle = panel.snapshot && findHandle(panel, layout, pointer(event));
      if (handle) panel.canvas.setPointerCapture(event.pointerId);
    };
    panel.canvas.onpointermove = (event) => {
      if (!handle) {
        panel.canvas.style.cursor = panel.snapshot && findHandle(panel, layout, pointer(event)) ? "grab" : "default";
        return;
      }
      const position = panel.view.world(...pointer(event)).map((v) => Math.round(100 * v) / 100);
      if (handle.kind === "person") {
        changes.people = { ...changes.people, [handle.index]: position };
        panels.forEach((other) => {
          const [x, y, ...rest] = other.snapshot.people[handle.index];
          const zone = other.snapshot.zones[handle.index];
          other.snapshot.people[handle.index] = [...position, ...rest];
          other.snapshot.zones[handle.index] = [zone[0] + position[0] - x, zone[1] + position[1] - y, ...zone.slice(2)];
          other.before = null;
        });
      } else if (handle.kind === "goal") {
        layout.goal = position;
        changes.goal = position;
      } else {
        layout.walls[handle.index].splice(handle.end, 2, ...position);
        changes.walls = layout.walls;
      }
      update();
    };
    panel.canvas.onpointerup = panel.canvas.onpointercancel = () => { handle = null; };
  });

  model.on("msg:custom", receive);
  labelButton();
  request("decide");
  requestAnimationFrame(drawFrame);
  return () => {
    alive = false;
    model.off("msg:custom", receive);
  };
}

export default { render };
