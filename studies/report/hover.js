// Numbers on the curves of the figures: the nearest point of a curve under the pointer.
"use strict";
const tip = document.body.appendChild(document.createElement("div"));
tip.className = "tip";
tip.hidden = true;

function tell(event, text) {
  tip.hidden = !text;
  if (!text) return;
  tip.textContent = text;
  const { width, height } = tip.getBoundingClientRect();
  const room = document.documentElement.clientWidth;
  tip.style.left = Math.max(4, Math.min(event.clientX + 14, room - width - 4)) + "px";
  tip.style.top = Math.max(4, event.clientY - height - 10) + "px";
}

const digits = (x) => (x === 0 ? "0" : String(Number(x.toPrecision(4))));

function pointer(svg, event) {
  return new DOMPoint(event.clientX, event.clientY).matrixTransform(svg.getScreenCTM().inverse());
}

function nearest(points, at, reach) {
  let best = null, least = reach * reach;
  for (const point of points) {
    const far = (point[0] - at.x) ** 2 + (point[1] - at.y) ** 2;
    if (far < least) [best, least] = [point, far];
  }
  return best;
}

function vertices(group) {
  const found = [];
  for (const use of group.querySelectorAll("use"))
    found.push([Number(use.getAttribute("x")), Number(use.getAttribute("y"))]);
  for (const path of group.querySelectorAll(":scope > path")) {
    const numbers = (path.getAttribute("d") || "").match(/-?[\d.]+(?:e-?\d+)?/g) || [];
    for (let i = 0; i + 1 < numbers.length; i += 2)
      found.push([Number(numbers[i]), Number(numbers[i + 1])]);
  }
  return found;
}

// Points of a curve of which the page has a picture: steps in tenths of a point.
function unpacked(steps) {
  const found = [];
  for (let i = 0, x = 0, y = 0; i < steps.length; i += 2)
    found.push([(x += steps[i]) / 10, (y += steps[i + 1]) / 10]);
  return found;
}

function value(share, [low, high, log]) {
  return log ? low * (high / low) ** share : low + share * (high - low);
}

for (const svg of document.querySelectorAll("svg[data-axes]")) {
  const axes = JSON.parse(svg.dataset.axes);
  const prefix = svg.closest("figure").dataset.name;
  let curves = null;
  svg.addEventListener("pointermove", (event) => {
    const packed = svg.dataset.points && !curves ? JSON.parse(svg.dataset.points) : null;
    curves ??= axes.map((ax, a) =>
      ax.names.map((name, k) => {
        if (packed) return { name, points: unpacked(packed[a][k]) };
        const group = svg.getElementById(`${prefix}-curve-${a}-${k}`);
        return { name, points: group ? vertices(group) : [] };
      }),
    );
    const at = pointer(svg, event);
    const a = axes.findIndex(({ box: [x, y, w, h] }) =>
      at.x >= x && at.x <= x + w && at.y >= y && at.y <= y + h);
    let text = "", least = 12;
    for (const curve of a < 0 ? [] : curves[a]) {
      const point = nearest(curve.points, at, least);
      if (!point) continue;
      least = Math.hypot(point[0] - at.x, point[1] - at.y);
      const { box: [x, y, w, h], x: across, y: up } = axes[a];
      const numbers = [value((point[0] - x) / w, across), value(1 - (point[1] - y) / h, up)];
      text = (curve.name ? curve.name + "\n" : "") + numbers.map(digits).join(", ");
    }
    tell(event, text);
  });
  svg.addEventListener("pointerleave", (event) => tell(event, ""));
}
