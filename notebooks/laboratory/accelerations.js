// Draws what a robot may choose in a step, for the laboratory and for recorded runs.

const ACTIVE = "#E69F00";  // colour of the active limit

function drawText(context, text, x, y, align = "left", colour = "#333333") {
  context.font = "11px sans-serif";
  context.textAlign = align;
  context.lineWidth = 3;
  context.strokeStyle = "rgba(255, 255, 255, 0.85)";
  context.strokeText(text, x, y);
  context.fillStyle = colour;
  context.fillText(text, x, y);
  context.textAlign = "left";
}

// Draws the admissible accelerations, the active limits with their names, and the chosen acceleration.
function drawAccelerations(context, size, snapshot, colours) {
  const a = snapshot.a_max, reach = 1.25 * a, left = 36, bottom = size - 34;
  const inner = makeView([-reach, reach, -reach, reach], size - left - 4, bottom - 4);
  context.fillStyle = "white";
  context.fillRect(0, 0, size, size);
  context.save();
  context.translate(left, 4);
  for (const v of [-a, 0, a]) {
    drawLine(context, inner, [[-reach, v], [reach, v]], "#dddddd", 1);
    drawLine(context, inner, [[v, -reach], [v, reach]], "#dddddd", 1);
  }
  context.beginPath();
  context.rect(0, 0, inner.width, inner.height);
  context.strokeStyle = "#999999";
  context.stroke();
  context.clip();
  for (const ring of snapshot.allowed) {
    context.beginPath();
    for (const [x, y] of ring) context.lineTo(...inner.pixel(x, y));
    context.closePath();
    context.fillStyle = `${colours.plan}66`;
    context.fill();
  }
  drawLine(context, inner, [[-a, -a], [a, -a], [a, a], [-a, a], [-a, -a]], "#555555", 1, [4, 3]);
  for (const { curve } of snapshot.active) drawLine(context, inner, curve, ACTIVE, 3.5);
  drawDiamond(context, inner.pixel(...snapshot.control), 7, colours.robot);
  snapshot.active.forEach(({ kind, number, curve }, i) => {
    const inside = curve.filter((point) => Math.max(...point.map(Math.abs)) < a);
    const [px, py] = inner.pixel(...(i % 2 ? inside.at(-1) : inside[0]) ?? [0, 0]);
    drawText(context, `${kind} ${number}`, px > inner.width / 2 ? px - 6 : px + 6, Math.max(14, py), px > inner.width / 2 ? "right" : "left", "black");
  });
  context.restore();
  for (const v of [-a, 0, a]) {
    const [px, py] = inner.pixel(v, v);
    drawText(context, `${v}`, left + px, bottom + 12, "center");
    drawText(context, `${v}`, left - 4, py + 8, "right");
  }
  drawText(context, "a_x [m/s\u00b2]", left + inner.width / 2, size - 6, "center");
  context.save();
  context.translate(10, 4 + inner.height / 2);
  context.rotate(-Math.PI / 2);
  drawText(context, "a_y [m/s\u00b2]", 0, 0, "center");
  context.restore();
}
