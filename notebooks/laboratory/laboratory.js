// The laboratory: a scene that a user drags and sets while the controller runs.
//
// The kernel computes each time step, and answers each change with what is there now. This page keeps these
// answers, so that it can show every time again. After a change that the kernel refuses, it draws what was there.

const WIDTH = 600, AXIS = 20;  // of the scene, and of the room for its numbers [pixels]
const GRAB_RADIUS = 16;  // distance within which the pointer takes hold of a thing [pixels]
const ARROW = 0.5;  // length of the arrow of a person who stands; 1 m longer for each m/s [m]
const FASTEST = 2.0;  // speed up to which the arrow of a person can be drawn [m/s]
const LONGEST = 1200;  // time steps after which the laboratory pauses
const SECOND = "#CC79A7", WAY = "#5E3C99";  // colours of the active limit, the second robot, ways
const SLIDERS = [
  { name: "N", label: "N [steps]", title: "length of the plan", min: 2, max: 24, step: 1 },
  { name: "N_h", label: "N_h [steps]", title: "of these, with barriers", min: 1, max: 24, step: 1 },
  { name: "gamma", label: "gamma", title: "share of h that a step may use up", min: 0.01, max: 1, step: 0.01 },
  { name: "v_max", label: "v_max [m/s]", title: "highest speed", min: 0.2, max: 2, step: 0.05 },
];
const LEGEND = [
  ["\u2192", "#D55E00", "velocity of a person"], ["\u25a1", "black", "end of a wall"],
  ["\u25cc", SECOND, "second robot (in the charts dotted)"], ["\u25a0", "#99d8c7", "admissible accelerations"],
  ["\u2501", ACTIVE, "active limit, and whose it is"], ["\u25c7", "#555555", "chosen acceleration"],
  ["\u2508", "#555555", "bound"], ["\u2501", WAY, "way that is taken"], ["\u2505", WAY, "other ways"],
];
const HELP = "Drag people, the tip of a person's arrow (direction and speed), the robot (\u25cf), the goal (\u25c6) or the ends of "
  + "walls (\u25a1), at any time. Each change begins a new run from the time that is shown.";

// --- drawing ---------------------------------------------------------------------------------------------

// The snapshot between two snapshots: `share` of the way from `before` to `now`.
function interpolate(before, now, share) {
  const mix = (a, b) => (a ? b.map((v, i) => (i < 2 ? a[i] + share * (v - a[i]) : v)) : b);
  const mixAll = (a, b) => b.map((each, i) => mix(a[i], each));
  return { ...now, robot: mix(before.robot, now.robot), people: mixAll(before.people, now.people), zones: mixAll(before.zones, now.zones) };
}

function drawCircle(context, [px, py], radius, colour, width, dash = []) {
  context.beginPath();
  context.arc(px, py, radius, 0, 2 * Math.PI);
  context.setLineDash(dash);
  context.strokeStyle = colour;
  context.lineWidth = width;
  context.stroke();
  context.setLineDash([]);
}

// The tip of the arrow of a person, {x, y}: it gives direction and speed.
function arrowTip([x, y, heading], speed) {
  const length = ARROW + speed;
  return [x + length * Math.cos(heading), y + length * Math.sin(heading)];
}

// Draws the ways of a robot: the one that is taken solid, the others dashed.
function drawWays(context, view, [taken, ...others]) {
  for (const points of others) drawLine(context, view, points, WAY, 1.5, [7, 4]);
  if (taken) drawLine(context, view, taken, WAY, 2.5);
}

// Draws what can be dragged, the active limits, and the second robot, over the scene.
function drawHandles(context, view, entry, shown, second, secondPath, ghost) {
  const { layout } = entry;
  for (const { kind, number } of shown.active) {
    if (kind === "wall") {
      const [xa, ya, xb, yb] = layout.walls[number], { limits } = layout;
      drawLine(context, view, [[xa, ya], [xb, yb]], ACTIVE, 5);
      const clamp = (v, low, high) => Math.min(high - 0.8, Math.max(low + 0.8, v));
      const middle = [clamp((xa + xb) / 2, limits[0], limits[1]), clamp((ya + yb) / 2, limits[2], limits[3])];
      const [px, py] = view.pixel(...middle);
      drawText(context, `wall ${number}`, px + 6, ya === yb ? py + (ya < 0 ? -8 : 16) : py, "left", "black");
    } else {
      const [x, y, a, b, angle] = shown.zones[number];
      context.beginPath();
      context.ellipse(...view.pixel(x, y), view.scale * a, view.scale * b, -angle, 0, 2 * Math.PI);
      context.strokeStyle = ACTIVE;
      context.lineWidth = 4;
      context.stroke();
    }
  }
  for (const [xa, ya, xb, yb] of layout.walls) {
    for (const end of [[xa, ya], [xb, yb]]) {
      const [px, py] = view.pixel(...end);
      context.fillStyle = "white";
      context.fillRect(px - 4, py - 4, 8, 8);
      context.strokeStyle = "black";
      context.lineWidth = 1.5;
      context.strokeRect(px - 4, py - 4, 8, 8);
    }
  }
  shown.people.forEach((person, i) => {
    const tip = arrowTip(person, entry.speeds[i]), [px, py] = view.pixel(...person), [qx, qy] = view.pixel(...tip);
    drawLine(context, view, [person.slice(0, 2), tip], layout.colours.person, 1.5);
    const angle = Math.atan2(qy - py, qx - px);
    context.beginPath();
    for (const turn of [0, 2.6, -2.6]) context.lineTo(qx + 7 * Math.cos(angle + turn), qy + 7 * Math.sin(angle + turn));
    context.closePath();
    context.fillStyle = layout.colours.person;
    context.fill();
    const isLeft = Math.cos(person[2]) > 0;
    drawText(context, shown.people.length > 2 ? `${i}` : `person ${i}`, px + (isLeft ? -11 : 11), py + 4, isLeft ? "right" : "left");
  });
  if (second) {
    drawLine(context, view, secondPath, SECOND, 1.5, [2, 3]);
    drawCircle(context, view.pixel(...second.robot), view.scale * layout.radius, SECOND, 2.5, [4, 3]);
  }
  if (ghost) drawCircle(context, view.pixel(...ghost), 9, "#333333", 1.5, [3, 2]);
}

// Draws lines over time. lines: [{values, colour, dash}], from `low` to `high`; levels: [{value, label, dash}].
function drawChart(context, width, height, { title, low, high, lines, levels }, times, now) {
  const left = 34, right = width - 10, top = 24, bottom = height - 22, end = Math.max(10, times[times.length - 1]);
  const x = (t) => left + ((right - left) * t) / end;
  const y = (v) => bottom - ((bottom - top) * (Math.min(high, Math.max(low, v)) - low)) / (high - low);
  const rule = (points, colour, lineWidth, dash = []) => {
    context.beginPath();
    for (const point of points) context.lineTo(...point);
    context.strokeStyle = colour;
    context.lineWidth = lineWidth;
    context.setLineDash(dash);
    context.stroke();
    context.setLineDash([]);
  };
  context.fillStyle = "white";
  context.fillRect(0, 0, width, height);
  drawText(context, title, 4, 12);
  const gap = [1, 2, 5, 10, 20, 50].find((d) => (d * (right - left)) / end >= 36) || 100;
  for (let t = 0; t <= end; t += gap) {
    rule([[x(t), top], [x(t), bottom]], "#eeeeee", 1);
    if (x(t) < right - 26) drawText(context, `${t}`, x(t), bottom + 12, "center");
  }
  drawText(context, "t [s]", right, bottom + 12, "right");
  for (const { value, label, dash } of levels) {
    rule([[left, y(value)], [right, y(value)]], dash ? "#555555" : "#cccccc", 1, dash);
    drawText(context, label, left - 4, y(value) + 4, "right");
  }
  for (const { values, colour, dash } of lines) {
    let points = [];
    values.forEach((value, i) => {
      if (value === null) { rule(points, colour, 1.8, dash); points = []; } else points.push([x(times[i]), y(value)]);
    });
    rule(points, colour, 1.8, dash);
  }
  rule([[x(now), top], [x(now), bottom]], "#0072B2", 1);
}

// --- the page --------------------------------------------------------------------------------------------

function addButton(parent, name, text, title) {
  return addElement(parent, "button", { type: "button", className: `szlib-${name}`, textContent: text, title });
}

function addSelect(parent, name, options, label) {
  const row = addElement(parent, "label", {}, { display: "flex", gap: "6px", alignItems: "center", fontSize: "12px" });
  addElement(row, "span", { textContent: label }, { whiteSpace: "nowrap" });
  const select = addElement(row, "select", { className: `szlib-${name}` }, { flex: "1", minWidth: "0" });
  for (const [value, text] of options) addElement(select, "option", { value, textContent: text });
  return select;
}

function addSlider(parent, { name, label, title, ...range }) {
  const row = addElement(parent, "label", { title }, { display: "flex", gap: "6px", alignItems: "center", fontSize: "12px" });
  addElement(row, "span", { textContent: label }, { width: "85px" });
  const input = addElement(row, "input", { type: "range", ...range, name }, { flex: "1", minWidth: "60px" });
  const output = addElement(row, "output", {}, { width: "34px", fontVariantNumeric: "tabular-nums" });
  input.oninput = () => { output.textContent = input.value; };
  return { input, show(value) { input.value = value; output.textContent = value; } };
}

// Builds the page, and returns its elements by name.
function build(el, content) {
  const flex = { display: "flex", gap: "8px", alignItems: "center", flexWrap: "wrap", margin: "4px 0" }, page = {};
  const bar = addElement(el, "div", {}, flex);
  page.scenario = addSelect(bar, "scenario", content.presets.map((name) => [name, name]), "scene");
  page.reset = addButton(bar, "reset", "reset", "the scene as it was at first");
  page.play = addButton(bar, "play", "", "play or pause");
  page.step = addButton(bar, "step", "step \u25b8", "one time step");
  page.pace = addSelect(bar, "pace", [0.5, 1, 2, 4].map((factor) => [factor, `${factor}\u00d7`]), "speed");
  page.pace.value = 2;
  page.add = addButton(bar, "add", "add person", "a person who stands where there is room");
  page.remove = addButton(bar, "remove", "remove person", "the person who was dragged last");
  page.share = addButton(bar, "share", "share", "Python code that computes what is on the screen");
  page.message = addElement(el, "div", { className: "szlib-error", role: "alert" }, { fontSize: "12px", color: "#a00000", minHeight: "1.3em" });
  const main = addElement(el, "div", {}, { display: "flex", gap: "14px", flexWrap: "wrap", alignItems: "flex-start" });
  const left = addElement(main, "div", {}, { width: `${WIDTH}px` }), right = addElement(main, "div", {}, { width: "300px", fontSize: "13px" });
  page.title = addElement(left, "div", { className: "szlib-title" }, { fontWeight: "bold", fontSize: "13px" });
  page.title.textContent = "Starting: the first picture comes when the kernel has built its controllers \u2026";
  page.scene = addElement(left, "canvas", { className: "szlib-lab-scene", role: "img", tabIndex: 0, ariaLabel: "the scene; space plays, the arrow keys step" }, { display: "block", touchAction: "none" });
  page.time = addElement(left, "input", { type: "range", min: 0, max: 0, step: 1, className: "szlib-time", ariaLabel: "time" }, { width: "100%" });
  const charts = addElement(left, "div", {}, { display: "flex", gap: "4px" });
  page.h = addElement(charts, "canvas", { role: "img", ariaLabel: "h over time" });
  page.speed = addElement(charts, "canvas", { role: "img", ariaLabel: "speed over time" });
  page.status = addElement(right, "div", { className: "szlib-status" }, { fontSize: "12px", fontVariantNumeric: "tabular-nums" });
  addElement(right, "strong", { textContent: "Why did it do this?" });
  page.why = addElement(right, "div", { className: "szlib-why", role: "status" }, { minHeight: "5.6em" });
  page.way = addElement(right, "div", { className: "szlib-way" });
  page.safety = addElement(right, "div", { className: "szlib-safety" }, { fontWeight: "bold", margin: "4px 0" });
  page.notes = addElement(right, "div", { className: "szlib-notes" }, { fontSize: "12px" });
  page.rival = addElement(right, "div", { className: "szlib-rival" }, { fontSize: "12px" });
  page.controls = addElement(right, "canvas", { role: "img", ariaLabel: "admissible accelerations, and the chosen one" });
  const constructors = Object.keys(content.settings).map((name) => [name, `${name}()`]);
  page.constructor = addSelect(right, "constructor", constructors, "robot");
  page.sliders = Object.fromEntries(SLIDERS.map((each) => [each.name, addSlider(right, each)]));
  page.second = addSelect(right, "second", [["", "nobody"], ...constructors], "compare with");
  addLegend(el, { robot: "#0072B2", person: "#D55E00", plan: "#009E73" }, LEGEND);
  addElement(el, "div", { textContent: HELP }, { fontSize: "12px" });
  page.code = addElement(el, "textarea", { className: "szlib-code", ariaLabel: "code", readOnly: true, rows: 14, hidden: true }, { width: "95%", fontFamily: "monospace" });
  return page;
}

function render({ model, el }) {
  const content = model.get("content"), page = build(el, content);
  el.dataset.lmSuppressShortcuts = "true";  // keys move the slider that has the focus, not JupyterLab's cells
  const chart = prepareCanvas(page.h, 298, 140), speedChart = prepareCanvas(page.speed, 298, 140);
  const polygon = prepareCanvas(page.controls, 260, 260);
  let entries = [], shown = 0, view = null, scene = null;  // the kernel's answers by time step; the one on the screen
  let changes = {}, waiting = false, playing = false, alive = true, dirty = false, due = 0, moved = 0;
  let held = null, ghost = null, selected = null;  // what is dragged, and where; the person who was dragged last

  const entry = () => entries[shown];
  const isLast = () => shown === entries.length - 1;
  const request = (kind) => {
    waiting = true;
    model.send({ kind, n: shown, changes });
    changes = {};
  };
  const change = (made) => {
    changes = { ...changes, ...made };
    if (!waiting) request("show");
  };
  const changePerson = (index, made) => change({ people: { ...changes.people, [index]: made && { ...changes.people?.[index], ...made } } });
  const go = (n) => {
    shown = Math.max(0, Math.min(entries.length - 1, n));
    moved = performance.now();
    dirty = true;
  };
  const setPlaying = (value) => {
    playing = value;
    page.play.textContent = playing ? "\u275a\u275a pause" : "\u25b6 play";
  };
  const advance = () => { if (isLast()) { if (!waiting) request("step"); } else go(shown + 1); };

  const receive = (message) => {
    if (message.kind === "code") {
      waiting = false;
      Object.assign(page.code, { value: message.text, hidden: false });
      page.code.select();
      return;
    }
    const before = entries[0];
    waiting = false;
    page.message.textContent = message.kind === "error" ? `Nothing has changed: ${message.text}` : "";
    if (message.kind === "error") setPlaying(false);
    entries.length = message.n;
    entries[message.n] = message;
    go(message.n);
    if (!before || String(before.layout.limits) !== String(message.layout.limits)) fit(message.layout.limits);
    showSettings();
    if (message.n >= LONGEST || message.arrived) setPlaying(false);
  };
  const fit = (limits) => {
    const ratio = (limits[3] - limits[2]) / (limits[1] - limits[0]), height = Math.round(Math.max(200, Math.min(400, WIDTH * ratio + AXIS)));
    scene = prepareCanvas(page.scene, WIDTH, height);
    view = makeView(limits, WIDTH, height, AXIS);
  };
  const showSettings = () => {
    const [robot, second] = entry().robots, settings = { ...content.settings[robot.constructor], ...robot.changes };
    page.scenario.value = entry().scenario;
    page.constructor.value = robot.constructor;
    page.second.value = second?.constructor ?? "";
    const hasGrid = robot.constructor === "MPCSettings.among_people";  // whose lengths of steps give N and N_h
    for (const [name, slider] of Object.entries(page.sliders)) {
      slider.show(settings[name]);
      slider.input.disabled = hasGrid && name.startsWith("N");
    }
  };

  // --- what is on the screen ---
  const draw = (share) => {
    const now = entry(), { layout } = now, [first, second] = now.snapshots, before = entries[shown - 1];
    const until = entries.slice(0, shown + 1), last = entries[entries.length - 1];
    const mix = (snapshot, i) => (share < 1 && before?.snapshots[i] ? interpolate(before.snapshots[i], snapshot, share) : snapshot);
    const path = (i) => [...until.slice(0, -1).flatMap((each) => (each.snapshots[i] ? [each.snapshots[i].robot] : [])), mix(now.snapshots[i], i).robot];
    drawScene(scene, view, layout, mix(first, 0), path(0));
    drawWays(scene, view, first.ways);
    drawHandles(scene, view, now, mix(first, 0), second && mix(second, 1), second && path(1), ghost);
    const times = entries.map((each) => each.snapshots[0].t), { robot, person } = layout.colours;
    const line = (i, name, colour, dash) => ({ values: entries.map((each) => each.snapshots[i]?.[name] ?? null), colour, dash });
    const isCompared = last.snapshots.length > 1;
    drawChart(chart, 298, 140, {
      title: "h [m]: \u2501 nearest person, \u2505 nearest wall", low: -0.25, high: 2,
      lines: [
        line(0, "h_people", person), line(0, "h_walls", "black", [6, 3]),
        ...(isCompared ? [line(1, "h_people", SECOND, [2, 2]), line(1, "h_walls", "#888888", [2, 2])] : []),
      ],
      levels: [{ value: 0, label: "0", dash: [] }, { value: 1, label: "1" }, { value: 2, label: "\u2265 2" }],
    }, times, first.t);
    const limit = first.v_max;
    drawChart(speedChart, 298, 140, {
      title: "speed [m/s], \u2505 limit v_max", low: 0, high: 1.15 * Math.max(limit, second?.v_max ?? 0),
      lines: [line(0, "speed", robot), ...(isCompared ? [line(1, "speed", SECOND, [2, 2])] : [])],
      levels: [{ value: 0, label: "0" }, { value: limit, label: `${limit}`, dash: [5, 3] }],
    }, times, first.t);
    drawAccelerations(polygon, 260, first, layout.colours);
    const h = [["person", first.h_people], ["wall", first.h_walls]].filter(([, value]) => value !== null);
    page.title.textContent = now.title || now.scenario;
    page.status.textContent = [`t = ${first.t.toFixed(1)} s`, `speed ${first.speed.toFixed(2)} m/s`, ...h.map(([name, value]) => `h of the nearest ${name} ${value.toFixed(2)} m`)].join(", ");
    if (page.why.textContent !== first.sentence) page.why.textContent = first.sentence;
    page.way.textContent = first.way;
    page.safety.textContent = first.safety;
    page.safety.style.color = first.safety.startsWith("Safe") ? "#00664d" : "#a00000";
    page.notes.textContent = first.notes.join(" ");
    page.rival.textContent = second ? `Second robot: ${second.sentence} ${second.safety}` : "";
    Object.assign(page.time, { max: entries.length - 1, value: shown });
    page.remove.textContent = now.speeds.length ? `remove person ${chosen()}` : "remove person";
    page.remove.disabled = !now.speeds.length;
  };
  const frame = (time) => {
    if (!alive) return;
    requestAnimationFrame(frame);
    if (!entry()) return;
    const period = (1000 * entry().layout.dt) / Number(page.pace.value);
    if (playing && time >= due) {
      due = time + period - 8;
      if (Object.keys(changes).length && !isLast()) { if (!waiting) request("show"); } else advance();
    } else if (!waiting && Object.keys(changes).length) request("show");
    const share = playing ? Math.min(1, (time - moved) / period) : 1;
    if (dirty || playing) draw(share);
    dirty = false;
  };

  // --- what a user does ---
  const chosen = () => Math.min(selected ?? Infinity, entry().speeds.length - 1);
  const findRoom = () => {
    const { layout, snapshots: [first] } = entry(), [x0, x1, y0, y1] = layout.limits, grid = [0.2, 0.35, 0.5, 0.65, 0.8];
    const taken = [first.robot, layout.goal, ...first.people];
    const clearance = ([x, y]) => Math.min(...taken.map(([px, py]) => Math.hypot(x - px, y - py)));
    const places = grid.flatMap((i) => grid.map((j) => [x0 + i * (x1 - x0), y0 + j * (y1 - y0)]));
    return places.sort((a, b) => clearance(b) - clearance(a))[0].map((v) => Math.round(10 * v) / 10);
  };
  const setRobots = (made) => {
    const [robot] = entry().robots, base = content.settings[page.constructor.value];
    const values = Object.entries({ ...(made.constructor_changed ? {} : robot.changes), ...made.settings });
    const first = { constructor: page.constructor.value, changes: Object.fromEntries(values.filter(([name, value]) => value !== base[name])) };
    change({ robots: [first, ...(page.second.value ? [{ constructor: page.second.value, changes: {} }] : [])] });
  };
  page.scenario.onchange = page.reset.onclick = () => {
    setPlaying(false);
    [changes, selected] = [{}, null];
    change({ scenario: page.scenario.value });
  };
  page.play.onclick = () => setPlaying(!playing);
  page.step.onclick = () => { setPlaying(false); advance(); };
  page.scene.onkeydown = (event) => {
    const action = { " ": page.play.onclick, ArrowRight: page.step.onclick, ArrowLeft: () => { setPlaying(false); go(shown - 1); } }[event.key];
    if (!action || !entry()) return;
    event.preventDefault();
    action();
  };
  page.time.oninput = () => { setPlaying(false); go(Number(page.time.value)); showSettings(); };
  page.add.onclick = () => { selected = entry().speeds.length; changePerson(selected, { position: findRoom() }); };
  page.remove.onclick = () => { changePerson(chosen(), null); selected = null; };
  page.share.onclick = () => { if (!waiting) request("share"); };
  page.constructor.onchange = () => setRobots({ constructor_changed: true, settings: {} });
  page.second.onchange = () => setRobots({ settings: {} });
  for (const [name, { input }] of Object.entries(page.sliders)) {
    input.onchange = () => {
      const settings = { [name]: Number(input.value) }, other = name === "N" ? "N_h" : "N";
      const isTooLong = name === "N" ? page.sliders.N_h.input.value > settings.N : settings.N_h > page.sliders.N.input.value;
      if (name.startsWith("N") && isTooLong) settings[other] = settings[name];
      setRobots({ settings });
    };
  }

  // What lies under the pointer: {kind, index, end}, or null.
  const findHandle = ([px, py]) => {
    const { layout, speeds, snapshots: [first] } = entry(), found = [];
    const add = (place, handle) => {
      const [qx, qy] = view.pixel(...place), distance = Math.hypot(px - qx, py - qy);
      if (distance <= GRAB_RADIUS) found.push({ ...handle, distance });
    };
    first.people.forEach((person, index) => {
      add(person, { kind: "person", index });
      add(arrowTip(person, speeds[index]), { kind: "arrow", index });
    });
    add(layout.goal, { kind: "goal" });
    add(first.robot, { kind: "start" });
    layout.walls.forEach(([xa, ya, xb, yb], index) => {
      add([xa, ya], { kind: "wall", index, end: 0 });
      add([xb, yb], { kind: "wall", index, end: 2 });
    });
    return found.sort((a, b) => a.distance - b.distance)[0] || null;
  };
  const drag = (place) => {
    const { kind, index, end } = held, { layout, snapshots: [first] } = entry();
    if (kind === "wall") {
      const walls = layout.walls.map((wall) => [...wall]);
      walls[index].splice(end, 2, ...place);
      change({ walls });
    } else if (kind === "arrow") {
      const [x, y] = first.people[index] ?? place, [dx, dy] = [place[0] - x, place[1] - y];
      const speed = Math.max(0, Math.min(FASTEST, Math.round(20 * (Math.hypot(dx, dy) - ARROW)) / 20));
      changePerson(index, { heading: Math.round(1000 * Math.atan2(dy, dx)) / 1000, speed });
    } else if (kind === "person") changePerson(index, { position: place });
    else change({ [kind]: place });
  };
  const pointer = (event) => [event.offsetX, event.offsetY];
  page.scene.onpointerdown = (event) => {
    held = entry() ? findHandle(pointer(event)) : null;
    if (!held) return;
    page.scene.setPointerCapture(event.pointerId);
    if (held.kind === "person" || held.kind === "arrow") selected = held.index;
    dirty = true;
  };
  page.scene.onpointermove = (event) => {
    if (!held) {
      page.scene.style.cursor = entry() && findHandle(pointer(event)) ? "grab" : "default";
      return;
    }
    const [x0, x1, y0, y1] = entry().layout.limits, [x, y] = view.world(...pointer(event));
    ghost = [Math.min(x1, Math.max(x0, x)), Math.min(y1, Math.max(y0, y))].map((v) => Math.round(100 * v) / 100);
    drag(ghost);
    dirty = true;
  };
  page.scene.onpointerup = page.scene.onpointercancel = () => {
    [held, ghost] = [null, null];
    dirty = true;
  };

  model.on("msg:custom", receive);
  setPlaying(false);
  request("show");
  requestAnimationFrame(frame);
  return () => {
    alive = false;
    model.off("msg:custom", receive);
  };
}

export default { render };
