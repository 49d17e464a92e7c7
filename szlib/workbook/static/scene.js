// Draws one scene on a canvas: what the players of finished runs and the laboratory share.
//
// stage   what stays: walls [[xa, ya, xb, yb]], goal [x, y], radius [m], colours, limits [x0, x1, y0, y1]
// moment  what moves: robot [x, y], people [[x, y, heading]], zones [[x, y, a, b, angle]], plan [[x, y]],
//         h [m], the least of all barriers; world frame, metres, radians

// A canvas of that many CSS pixels, sharp on every screen; its 2D context.
function surface(canvas, width, height) {
  const ratio = window.devicePixelRatio || 1;
  canvas.width = Math.round(width * ratio);
  canvas.height = Math.round(height * ratio);
  canvas.style.width = `${width}px`;
  canvas.style.height = `${height}px`;
  const context = canvas.getContext("2d");
  context.scale(ratio, ratio);
  return context;
}

// How metres become pixels: as large as fits, y upwards.
function view([x0, x1, y0, y1], width, height) {
  const scale = Math.min(width / (x1 - x0), height / (y1 - y0));
  const left = (width - scale * (x1 - x0)) / 2, top = (height - scale * (y1 - y0)) / 2;
  return {
    scale, width, height,
    pixel: (x, y) => [left + scale * (x - x0), top + scale * (y1 - y)],
    world: (px, py) => [x0 + (px - left) / scale, y1 - (py - top) / scale],
  };
}

function line(context, at, points, colour, width, dash = []) {
  context.beginPath();
  for (const [x, y] of points) context.lineTo(...at.pixel(x, y));
  context.strokeStyle = colour;
  context.lineWidth = width;
  context.setLineDash(dash);
  context.stroke();
  context.setLineDash([]);
}

function diamond(context, [x, y], size, fill) {
  context.beginPath();
  for (const [dx, dy] of [[0, -size], [size, 0], [0, size], [-size, 0]]) context.lineTo(x + dx, y + dy);
  context.closePath();
  context.fillStyle = fill;
  context.fill();
  context.strokeStyle = "black";
  context.lineWidth = 1;
  context.stroke();
}

// A grid of metres with its numbers, every so many as there is room for.
function grid(context, at, [x0, x1, y0, y1]) {
  const every = [1, 2, 5, 10, 20, 50].find((d) => d * at.scale >= 45) || 100;
  context.font = "11px sans-serif";
  context.fillStyle = "#555555";
  for (let x = Math.ceil(x0 / every) * every; x <= x1; x += every) {
    line(context, at, [[x, y0], [x, y1]], "#eeeeee", 1);
    const [px, py] = at.pixel(x, y0);
    context.fillText(x + every > x1 ? `x = ${x} m` : `${x}`, Math.min(px + 2, at.width - 50), py - 3);
  }
  for (let y = Math.ceil((y0 + 0.3) / every) * every; y <= y1; y += every) {
    line(context, at, [[x0, y], [x1, y]], "#eeeeee", 1);
    const [px, py] = at.pixel(x0, y);
    context.fillText(y + every > y1 ? `y = ${y} m` : `${y}`, px + 2, Math.max(py - 2, 11));
  }
}

function scene(context, at, stage, moment, path) {
  const { colours } = stage;
  context.clearRect(0, 0, at.width, at.height);
  context.fillStyle = "white";
  context.fillRect(0, 0, at.width, at.height);
  grid(context, at, stage.limits);
  for (const [xa, ya, xb, yb] of stage.walls) line(context, at, [[xa, ya], [xb, yb]], "black", 4);
  diamond(context, at.pixel(...stage.goal), 7, colours.robot);
  line(context, at, path, colours.robot, 1.5);
  moment.zones.forEach(([x, y, a, b, angle]) => {
    context.beginPath();
    context.ellipse(...at.pixel(x, y), at.scale * a, at.scale * b, -angle, 0, 2 * Math.PI);
    context.fillStyle = `${colours.person}18`;
    context.fill();
    context.strokeStyle = colours.person;
    context.lineWidth = 2;
    context.stroke();
  });
  for (const [x, y, heading] of moment.people) {
    const [px, py] = at.pixel(x, y);
    context.beginPath();
    for (const turn of [0, 2.5, -2.5]) {
      context.lineTo(px + 8 * Math.cos(heading + turn), py - 8 * Math.sin(heading + turn));
    }
    context.closePath();
    context.fillStyle = colours.person;
    context.fill();
  }
  context.beginPath();
  context.arc(...at.pixel(...moment.robot), at.scale * stage.radius, 0, 2 * Math.PI);
  context.fillStyle = `${colours.robot}99`;
  context.fill();
  context.fillStyle = colours.plan;
  for (const [x, y] of moment.plan) {
    context.beginPath();
    context.arc(...at.pixel(x, y), 1.8, 0, 2 * Math.PI);
    context.fill();
  }
}

// h over time, up to `top` metres, with a mark at `now`: safe where it is not below the line of zero.
function barriers(context, width, height, times, values, now, span, colours) {
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

function element(parent, name, properties = {}, style = {}) {
  const made = document.createElement(name);
  Object.assign(made, properties);
  Object.assign(made.style, style);
  parent.appendChild(made);
  return made;
}

// What is what: a mark that tells without colour, and its name.
function legend(parent, colours) {
  const row = element(parent, "div", {}, { fontSize: "12px", display: "flex", gap: "14px", flexWrap: "wrap" });
  const marks = [
    ["\u25cf", colours.robot, "robot"], ["\u25c6", colours.robot, "goal"], ["\u25b6", colours.person, "person"],
    ["\u25cb", colours.person, "zone"], ["\u2026", colours.plan, "plan"], ["\u2500", colours.robot, "path"],
    ["\u2501", "black", "wall"],
  ];
  for (const [mark, colour, name] of marks) {
    const item = element(row, "span");
    element(item, "span", { textContent: `${mark} `, ariaHidden: "true" }, { color: colour, fontWeight: "bold" });
    element(item, "span", { textContent: name });
  }
  return row;
}
