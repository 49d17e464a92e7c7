// Draws one scene on a canvas, for the players of finished runs and for the laboratory.
//
// layout    what does not move: walls [[xa, ya, xb, yb]], goal [x, y], limits [x0, x1, y0, y1], radius [m], colours
// snapshot  what moves: robot [x, y], people [[x, y, heading]], zones [[x, y, a, b, angle]], plan [[x, y]],
//           h [m], the least of all barriers
//
// Positions are in the world frame, in metres and radians.

// Sets the size of a canvas in CSS pixels, sharp on every screen, and returns its 2D context.
function prepareCanvas(canvas, width, height) {
  const ratio = window.devicePixelRatio || 1;
  canvas.width = Math.round(width * ratio);
  canvas.height = Math.round(height * ratio);
  canvas.style.width = `${width}px`;
  canvas.style.height = `${height}px`;
  const context = canvas.getContext("2d");
  context.scale(ratio, ratio);
  return context;
}

// Converts metres to pixels and back: as large as possible, y upwards; `axis` leaves that many pixels for numbers.
function makeView([x0, x1, y0, y1], width, height, axis = 0) {
  const scale = Math.min((width - 2 * axis) / (x1 - x0), (height - axis) / (y1 - y0));
  const left = (width - scale * (x1 - x0)) / 2, top = (height - axis - scale * (y1 - y0)) / 2;
  return {
    scale, width, height, axis,
    pixel: (x, y) => [left + scale * (x - x0), top + scale * (y1 - y)],
    world: (px, py) => [x0 + (px - left) / scale, y1 - (py - top) / scale],
  };
}

function drawLine(context, view, points, colour, width, dash = []) {
  context.beginPath();
  for (const [x, y] of points) context.lineTo(...view.pixel(x, y));
  context.strokeStyle = colour;
  context.lineWidth = width;
  context.setLineDash(dash);
  context.stroke();
  context.setLineDash([]);
}

function drawDiamond(context, [x, y], size, fill) {
  context.beginPath();
  for (const [dx, dy] of [[0, -size], [size, 0], [0, size], [-size, 0]]) context.lineTo(x + dx, y + dy);
  context.closePath();
  context.fillStyle = fill;
  context.fill();
  context.strokeStyle = "black";
  context.lineWidth = 1;
  context.stroke();
}

// Draws a grid in metres with numbers, beside it if the view has room for them; the spacing depends on the scale.
function drawGrid(context, view, [x0, x1, y0, y1]) {
  const spacing = [1, 2, 5, 10, 20, 50].find((d) => d * view.scale >= 45) || 100;
  const [left, bottom] = view.pixel(x0, y0), [right, top] = view.pixel(x1, y1), beside = view.axis > 0;
  context.font = "11px sans-serif";
  context.fillStyle = "#555555";
  for (let x = Math.ceil(x0 / spacing) * spacing; x <= x1; x += spacing) {
    const px = view.pixel(x, y0)[0];
    drawLine(context, view, [[x, y0], [x, y1]], "#eeeeee", 1);
    if (px < right - 44) context.fillText(`${x}`, px + 2, beside ? bottom + 12 : bottom - 3);
  }
  for (let y = Math.ceil((y0 + 0.3) / spacing) * spacing; y <= y1; y += spacing) {
    const py = view.pixel(x0, y)[1], width = context.measureText(`${y}`).width;
    drawLine(context, view, [[x0, y], [x1, y]], "#eeeeee", 1);
    if (py > top + 24) context.fillText(`${y}`, beside ? left - width - 3 : left + 2, beside ? py + 4 : py - 2);
  }
  context.fillText("x [m]", right - 30, beside ? bottom + 12 : bottom - 3);
  context.fillText("y [m]", beside ? Math.max(0, left - 30) : left + 2, top + 11);
}

function drawScene(context, view, layout, snapshot, path) {
  const { colours } = layout;
  context.clearRect(0, 0, view.width, view.height);
  context.fillStyle = "white";
  context.fillRect(0, 0, view.width, view.height);
  drawGrid(context, view, layout.limits);
  for (const [xa, ya, xb, yb] of layout.walls) drawLine(context, view, [[xa, ya], [xb, yb]], "black", 4);
  drawDiamond(context, view.pixel(...layout.goal), 7, colours.robot);
  drawLine(context, view, path, colours.robot, 1.5);
  snapshot.zones.forEach(([x, y, a, b, angle]) => {
    context.beginPath();
    context.ellipse(...view.pixel(x, y), view.scale * a, view.scale * b, -angle, 0, 2 * Math.PI);
    context.fillStyle = `${colours.person}18`;
    context.fill();
    context.strokeStyle = colours.person;
    context.lineWidth = 2;
    context.stroke();
  });
  for (const [x, y, heading] of snapshot.people) {
    const [px, py] = view.pixel(x, y);
    context.beginPath();
    for (const turn of [0, 2.5, -2.5]) {
      context.lineTo(px + 8 * Math.cos(heading + turn), py - 8 * Math.sin(heading + turn));
    }
    context.closePath();
    context.fillStyle = colours.person;
    context.fill();
  }
  context.beginPath();
  context.arc(...view.pixel(...snapshot.robot), view.scale * layout.radius, 0, 2 * Math.PI);
  context.fillStyle = `${colours.robot}99`;
  context.fill();
  context.fillStyle = colours.plan;
  for (const [x, y] of snapshot.plan) {
    context.beginPath();
    context.arc(...view.pixel(x, y), 1.8, 0, 2 * Math.PI);
    context.fill();
  }
}

// Draws h over time, up to `top` metres, with a mark at `now`. It is safe where h >= 0.
function drawBarriers(context, width, height, times, values, now, span, colours) {
  const top = 2, low = Math.min(-0.1, ...values.slice(-2000)), left = 34, bottom = 16;
  const x = (t) => left + ((t - span[0]) / Math.max(span[1] - span[0], 1e-9)) * (width - left - 8);
  const y = (h) => 18 + ((top - Math.min(h, top)) / (top - low)) * (height - bottom - 22);
  context.clearRect(0, 0, width, height);
  context.fillStyle = "white";
  context.fillRect(0, 0, width, height);
  context.font = "11px sans-serif";
  context.fillStyle = "#555555";
  for (const h of [0, 1, 2]) {
    context.fillText(h === 2 ? "\u2265 2" : `${h}`, 12, y(h) + 4);
    context.fillStyle = h === 0 ? "black" : "#dddddd";
    context.fillRect(left, y(h), width - left - 8, h === 0 ? 1.5 : 1);
    context.fillStyle = "#555555";
  }
  context.fillText("least h of people and walls [m] over time", left, 12);
  context.fillText(`${span[0].toFixed(0)} s`, left, height - 3);
  context.fillText(`${span[1].toFixed(0)} s`, width - 30, height - 3);
  context.beginPath();
  values.forEach((h, i) => {
    if (h !== null && times[i] >= span[0]) context.lineTo(x(times[i]), y(h));
  });
  context.strokeStyle = colours.person;
  context.lineWidth = 1.5;
  context.stroke();
  context.fillStyle = colours.robot;
  context.fillRect(x(now) - 1, 16, 2, height - bottom - 14);
}

function addElement(parent, name, properties = {}, style = {}) {
  const added = document.createElement(name);
  Object.assign(added, properties);
  Object.assign(added.style, style);
  parent.appendChild(added);
  return added;
}

// Adds a legend; its marks can be distinguished without colour. `more`: further marks, [mark, colour, name].
function addLegend(parent, colours, more = []) {
  const row = addElement(parent, "div", {}, { fontSize: "12px", display: "flex", gap: "14px", flexWrap: "wrap" });
  const marks = [
    ["\u25cf", colours.robot, "robot"], ["\u25c6", colours.robot, "goal"], ["\u25b6", colours.person, "person"],
    ["\u25cb", colours.person, "zone"], ["\u2026", colours.plan, "plan"], ["\u2500", colours.robot, "path"],
    ["\u2501", "black", "wall"], ...more,
  ];
  for (const [mark, colour, name] of marks) {
    const item = addElement(row, "span");
    addElement(item, "span", { textContent: `${mark} `, ariaHidden: "true" }, { color: colour, fontWeight: "bold" });
    addElement(item, "span", { textContent: name });
  }
  return row;
}
