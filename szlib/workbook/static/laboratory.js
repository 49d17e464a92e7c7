// The laboratory: a scene for each robot, side by side, that can be dragged and set while it runs.
// The kernel computes every step; this page asks for the next one when the last has come.

const GRASP = 16;  // pixels within which something is taken hold of

function between(before, now, share) {
  const mix = (a, b) => (a && b && a.length === b.length ? b.map((v, i) => a[i] + share * (v - a[i])) : b);
  const moved = (a, b) => mix(a, b).concat();
  const zones = now.zones.map((zone, i) => [...moved(before.zones[i]?.slice(0, 2), zone.slice(0, 2)), ...zone.slice(2)]);
  const people = now.people.map((p, i) => [...moved(before.people[i]?.slice(0, 2), p.slice(0, 2)), ...p.slice(2)]);
  return { ...now, robot: mix(before.robot, now.robot), zones, people };
}

// What could have been chosen, and what was: accelerations ahead to the right, as x is.
function accelerations(context, size, moment, colours) {
  const reach = 1.2 * moment.a_max, at = view([-reach, reach, -reach, reach], size, size);
  context.clearRect(0, 0, size, size);
  context.fillStyle = "white";
  context.fillRect(0, 0, size, size);
  const a = moment.a_max;
  line(context, at, [[-a, -a], [a, -a], [a, a], [-a, a], [-a, -a]], "#555555", 1, [4, 3]);
  line(context, at, [[-reach, 0], [reach, 0]], "#cccccc", 1);
  line(context, at, [[0, -reach], [0, reach]], "#cccccc", 1);
  for (const ring of moment.free) {
    context.beginPath();
    for (const [x, y] of ring) context.lineTo(...at.pixel(x, y));
    context.closePath();
    context.fillStyle = `${colours.plan}55`;
    context.fill();
    context.strokeStyle = colours.plan;
    context.lineWidth = 1.5;
    context.stroke();
  }
  diamond(context, at.pixel(...moment.control), 5, colours.robot);
  context.fillStyle = "#555555";
  context.font = "11px sans-serif";
  context.fillText(`\u00b1${a.toFixed(1)} m/s\u00b2`, 3, 11);
}

// One robot: its canvases, what it is doing in words, its sliders.
function panel(parent, index, begin, change) {
  const { stage } = begin, width = 430, [x0, x1, y0, y1] = stage.limits;
  const height = Math.round(Math.max(180, Math.min(400, (width * (y1 - y0)) / (x1 - x0))));
  const box = element(parent, "div", { className: "szlib-panel" }, { width: `${width}px` });
  const name = String.fromCharCode(65 + index);
  element(box, "strong", { textContent: `Robot ${name}` });
  const canvas = element(box, "canvas", { role: "img", ariaLabel: `scene of robot ${name}` }, { display: "block", touchAction: "none" });
  const row = element(box, "div", {}, { display: "flex", gap: "4px", marginTop: "4px" });
  const chart = element(row, "canvas", { role: "img", ariaLabel: `the least h of robot ${name} over time` });
  const choice = element(row, "canvas", { role: "img", ariaLabel: `admissible accelerations of robot ${name}, and the one chosen` });
  const told = element(box, "div", { className: "szlib-told", role: "status" }, { fontSize: "12px", fontVariantNumeric: "tabular-nums", minHeight: "2.6em" });
  const it = {
    at: view(stage.limits, width, height), canvas, told, moment: null, before: null, path: [], times: [], values: [],
    forget() { it.path = []; it.times = []; it.values = []; it.before = null; },
    take(moment) {
      it.before = it.moment;
      it.moment = moment;
      if (it.times.length && moment.t === it.times[it.times.length - 1]) return;
      it.path.push(moment.robot);
      it.times.push(moment.t);
      it.values.push(moment.h);
    },
    draw(share) {
      if (!it.moment) return;
      const shown = it.before && share < 1 ? between(it.before, it.moment, share) : it.moment;
      scene(on, it.at, stage, shown, [...it.path.slice(0, -1), shown.robot]);
      for (const [xa, ya, xb, yb] of stage.walls) {
        for (const end of [[xa, ya], [xb, yb]]) {
          const [px, py] = it.at.pixel(...end);
          on.strokeStyle = "black";
          on.fillStyle = "white";
          on.lineWidth = 1.5;
          on.fillRect(px - 4, py - 4, 8, 8);
          on.strokeRect(px - 4, py - 4, 8, 8);
        }
      }
      const now = it.moment.t;
      barriers(under, 310, 112, it.times, it.values, now, [Math.max(0, now - 20), Math.max(20, now)], stage.colours);
      accelerations(aside, 112, it.moment, stage.colours);
      const h = it.moment.h === null ? "" : `, least h ${it.moment.h.toFixed(2)} m`;
      told.textContent = `t = ${now.toFixed(1)} s, ${it.moment.speed.toFixed(2)} m/s${h}, rung: ${it.moment.rung}, ${it.moment.told}`;
    },
  };
  const on = surface(canvas, width, height), under = surface(chart, 310, 112), aside = surface(choice, 112, 112);
  for (const control of begin.sliders) slider(box, control, begin.choices[index][control.name], (value) => change(index, control.name, value));
  const line = element(box, "label", {}, { display: "flex", gap: "8px", fontSize: "12px" });
  element(line, "span", { textContent: "estimator" }, { width: "150px" });
  const select = element(line, "select", { ariaLabel: `estimator of robot ${name}` });
  for (const one of begin.estimators) element(select, "option", { value: one, textContent: one, selected: one === begin.choices[index].estimator });
  select.onchange = () => change(index, "estimator", select.value);
  return it;
}

function slider(parent, control, value, set) {
  const row = element(parent, "label", {}, { display: "flex", gap: "8px", alignItems: "center", fontSize: "12px" });
  element(row, "span", { textContent: control.label }, { width: "150px" });
  const range = { min: control.low, max: control.high, step: control.step };
  const input = element(row, "input", { type: "range", ...range, name: control.name }, { flex: "1" });
  input.value = value;
  const shown = element(row, "output", { textContent: value }, { width: "40px", fontVariantNumeric: "tabular-nums" });
  input.oninput = () => {
    shown.textContent = input.value;
    set(Number(input.value));
  };
}

// What lies under the pointer: {what, index, end}, or null.
function held(it, stage, [px, py]) {
  const found = [];
  const near = (x, y, what) => {
    const [qx, qy] = it.at.pixel(x, y), far = Math.hypot(px - qx, py - qy);
    if (far <= GRASP) found.push({ ...what, far });
  };
  it.moment.people.forEach(([x, y], index) => near(x, y, { what: "person", index }));
  near(...stage.goal, { what: "goal" });
  stage.walls.forEach(([xa, ya, xb, yb], index) => {
    near(xa, ya, { what: "wall", index, end: 0 });
    near(xb, yb, { what: "wall", index, end: 2 });
  });
  return found.sort((a, b) => a.far - b.far)[0] || null;
}

function render({ model, el }) {
  const begin = structuredClone(model.get("begin")), { stage } = begin;
  el.dataset.lmSuppressShortcuts = "true";  // keys move the slider that has the focus, not JupyterLab's cells
  let changed = {}, running = false, waiting = false, asked = 0, came = 0, alive = true, drawn = 0, steps = 0, since = 0;

  const bar = element(el, "div", {}, { display: "flex", gap: "10px", alignItems: "center", flexWrap: "wrap", margin: "4px 0" });
  const start = element(bar, "button", { type: "button", className: "szlib-run" });
  const again = element(bar, "button", { type: "button", textContent: "restart" });
  const pace = element(bar, "select", { ariaLabel: "pace" });
  for (const times of [0.5, 1, 2, 4]) element(pace, "option", { value: times, textContent: `${times}\u00d7`, selected: times === 2 });
  const speed = element(bar, "div", {}, { width: "330px" });
  slider(speed, { ...begin.speed, name: "speed" }, begin.speed.value, (value) => { changed.speed = value; look(); });
  const share = element(bar, "button", { type: "button", textContent: "share", className: "szlib-share" });
  const rate = element(bar, "span", { className: "szlib-rate" }, { fontSize: "12px" });
  const row = element(el, "div", {}, { display: "flex", gap: "14px", flexWrap: "wrap" });
  const change = (index, name, value) => {
    changed.choices = { ...changed.choices, [index]: { ...changed.choices?.[index], [name]: value } };
    look();
  };
  const panels = begin.choices.map((_, index) => panel(row, index, begin, change));
  legend(el, stage.colours);
  element(el, "div", { textContent: "Drag the person, the goal (\u25c6) and the ends of walls (\u25a1)." }, { fontSize: "12px" });
  const refused = element(el, "div", { className: "szlib-refused", role: "alert" }, { fontSize: "12px", color: "#a00000" });
  const cell = element(el, "textarea", { className: "szlib-cell", ariaLabel: "parameter cell", readOnly: true, rows: 12, hidden: true }, { width: "95%", fontFamily: "monospace" });

  const ask = (kind) => {
    waiting = true;
    asked = performance.now();
    model.send({ kind, changed });
    changed = {};
  };
  const look = () => { if (!waiting && !running) ask("look"); };
  const frame = (now) => {
    if (!alive) return;
    requestAnimationFrame(frame);
    const every = (1000 * stage.dt) / Number(pace.value);
    if (running && !waiting && now - asked >= every - 8) ask("step");
    else if (!running && !waiting && Object.keys(changed).length) ask("look");
    const share = running ? Math.min(1, (now - came) / every) : 1;
    panels.forEach((it) => it.draw(share));
    drawn += 1;
    if (now - since >= 1000) {
      const rates = [drawn, steps].map((n) => ((1000 * n) / (now - since)).toFixed(0));
      rate.textContent = running ? `${rates[0]} frames/s, ${rates[1]} steps/s` : "";
      [drawn, steps, since] = [0, 0, now];
    }
  };
  const answer = (message) => {
    if (message.kind === "moments") {
      waiting = false;
      refused.textContent = "";
      came = performance.now();
      steps += 1;
      if (message.moments[0].t < (panels[0].moment?.t ?? 0)) panels.forEach((it) => it.forget());
      message.moments.forEach((moment, i) => panels[i].take(moment));
    } else if (message.kind === "refused") {
      waiting = false;
      running = false;
      label();
      refused.textContent = message.text;
      Object.assign(stage, message.stage);
    } else if (message.kind === "cell") {
      cell.value = message.text;
      cell.hidden = false;
      cell.select();
    }
  };
  const label = () => { start.textContent = running ? "\u275a\u275a pause" : "\u25b6 run"; };
  start.onclick = () => { running = !running; label(); };
  again.onclick = () => { changed.restart = true; if (!waiting) ask("look"); };
  share.onclick = () => {
    model.send({ kind: "share", changed });
    changed = {};
  };

  panels.forEach((it) => {
    let grip = null;
    const place = (event) => [event.offsetX, event.offsetY];
    it.canvas.onpointerdown = (event) => {
      grip = it.moment && held(it, stage, place(event));
      if (grip) it.canvas.setPointerCapture(event.pointerId);
    };
    it.canvas.onpointermove = (event) => {
      if (!grip) {
        it.canvas.style.cursor = it.moment && held(it, stage, place(event)) ? "grab" : "default";
        return;
      }
      const at = it.at.world(...place(event)).map((v) => Math.round(100 * v) / 100);
      if (grip.what === "person") {
        changed.people = { ...changed.people, [grip.index]: at };
        panels.forEach((other) => {
          const [x, y, ...rest] = other.moment.people[grip.index];
          const zone = other.moment.zones[grip.index];
          other.moment.people[grip.index] = [...at, ...rest];
          other.moment.zones[grip.index] = [zone[0] + at[0] - x, zone[1] + at[1] - y, ...zone.slice(2)];
          other.before = null;
        });
      } else if (grip.what === "goal") {
        stage.goal = at;
        changed.goal = at;
      } else {
        stage.walls[grip.index].splice(grip.end, 2, ...at);
        changed.walls = stage.walls;
      }
      look();
    };
    it.canvas.onpointerup = it.canvas.onpointercancel = () => { grip = null; };
  });

  model.on("msg:custom", answer);
  label();
  ask("look");
  requestAnimationFrame(frame);
  return () => {
    alive = false;
    model.off("msg:custom", answer);
  };
}

export default { render };
