// The slider: every model with the airspeed held at one value.
(() => {
  const host = document.getElementById("explorer");
  if (!host) return;
  const held = JSON.parse(document.getElementById("held").textContent);
  const speeds = held.airspeed.value;
  const looks = {
    "exact": { colour: "#1b1f24", width: 3, mark: "circle" },
    "LFT, cubic": { colour: "#d9730d", width: 1.6, mark: "plus", dash: "6 3" },
    "LPV-ARX": { colour: "#b3261e", width: 1.4, mark: "cross", dash: "2 2" },
    "known kinematics": { colour: "#0b61a4", width: 1.4, mark: "diamond" },
  };
  const find = (selector) => host.querySelector(selector);
  const space = document.querySelector("#explorer svg").namespaceURI;
  const W = 420, H = 270, L = 58, R = 10, T = 26, B = 40;

  function put(parent, kind, attributes, text) {
    const element = parent.appendChild(document.createElementNS(space, kind));
    for (const [name, v] of Object.entries(attributes)) element.setAttribute(name, v);
    if (text !== undefined) element.textContent = text;
    return element;
  }

  function ticks([low, high], log) {
    if (log) {
      const found = [];
      for (let e = Math.ceil(Math.log10(low) - 1e-9); e <= Math.log10(high) + 1e-9; e++) found.push(10 ** e);
      return found;
    }
    const raw = (high - low) / 5, size = 10 ** Math.floor(Math.log10(raw));
    const step = size * [1, 2, 5, 10].find((m) => m * size >= raw);
    const found = [];
    for (let t = Math.ceil(low / step - 1e-9) * step; t <= high + 1e-9 * step; t += step) found.push(Math.abs(t) < step / 1e6 ? 0 : t);
    return found;
  }

  function panel(svg, { title, across, x, y, xlog, ylog }) {
    svg.replaceChildren();
    const place = (v, [low, high], log) => log ? Math.log(v / low) / Math.log(high / low) : (v - low) / (high - low);
    const px = (v) => L + (W - L - R) * place(v, x, xlog);
    const py = (v) => H - B - (H - T - B) * place(v, y, ylog);
    put(svg, "text", { x: 4, y: 15, "font-size": 13, fill: "#1b1f24" }, title);
    put(svg, "text", { x: (L + W - R) / 2, y: H - 6, "font-size": 11.5, fill: "#4a545e", "text-anchor": "middle" }, across);
    for (const t of ticks(x, xlog)) {
      put(svg, "line", { x1: px(t), x2: px(t), y1: T, y2: H - B, stroke: t === 0 ? "#8a949e" : "#e6e9ec" });
      put(svg, "text", { x: px(t), y: H - B + 15, "font-size": 11, fill: "#4a545e", "text-anchor": "middle" }, digits(t));
    }
    for (const t of ticks(y, ylog)) {
      put(svg, "line", { y1: py(t), y2: py(t), x1: L, x2: W - R, stroke: t === 0 ? "#8a949e" : "#e6e9ec" });
      put(svg, "text", { x: L - 5, y: py(t) + 4, "font-size": 11, fill: "#4a545e", "text-anchor": "end" }, digits(t));
    }
    const known = [];
    const inside = (v, [low, high]) => v >= low && v <= high;
    return {
      px, py,
      line(name, xs, ys, look) {
        let d = "", pen = "M";
        xs.forEach((v, i) => {
          if (!inside(ys[i], y) || !inside(v, x)) { pen = "M"; return; }
          const at = [px(v), py(ys[i])];
          d += pen + at[0].toFixed(1) + " " + at[1].toFixed(1);
          pen = "L";
          known.push([...at, name, v, ys[i]]);
        });
        put(svg, "path", { d, fill: "none", stroke: look.colour, "stroke-width": look.width, "stroke-dasharray": look.dash || "none" });
      },
      points(name, xs, ys, look) {
        xs.forEach((v, i) => {
          if (!inside(v, x) || !inside(ys[i], y)) return;
          const a = px(v), b = py(ys[i]), r = look.mark === "circle" ? 5 : 4.5;
          const d = {
            circle: `M${a - r} ${b}a${r} ${r} 0 1 0 ${2 * r} 0a${r} ${r} 0 1 0 ${-2 * r} 0`,
            plus: `M${a - r} ${b}H${a + r}M${a} ${b - r}V${b + r}`,
            cross: `M${a - r} ${b - r}L${a + r} ${b + r}M${a - r} ${b + r}L${a + r} ${b - r}`,
            diamond: `M${a - r} ${b}L${a} ${b - r}L${a + r} ${b}L${a} ${b + r}Z`,
          }[look.mark];
          put(svg, "path", { d, fill: "none", stroke: look.colour, "stroke-width": 1.8 });
          known.push([a, b, name, v, ys[i]]);
        });
      },
      upright(v) { put(svg, "line", { x1: px(v), x2: px(v), y1: T, y2: H - B, stroke: "#0b61a4", "stroke-width": 1, "stroke-dasharray": "3 3" }); },
      known,
    };
  }

  const shown = {};
  function watch(svg) {
    svg.addEventListener("pointermove", (event) => {
      const found = nearest(shown[svg.dataset.panel] || [], pointer(svg, event), 14);
      tell(event, found ? `${found[2]}\n${digits(found[3])}, ${digits(found[4])}` : "");
    });
    svg.addEventListener("pointerleave", (event) => tell(event, ""));
  }

  const range = (numbers, share) => {
    const low = Math.min(...numbers), high = Math.max(...numbers), more = share * (high - low || 1);
    return [low - more, high + more];
  };

  function draw() {
    const k = Number(find("input[type=range]").value);
    const axis = held.axes.find((one) => one.axis === find("[name=axis]:checked").value);
    const wanted = new Set([...host.querySelectorAll("[name=model]:checked")].map((box) => box.value));
    const models = axis.models.filter((model) => wanted.has(model.name));
    const exact = axis.models.find((model) => model.name === "exact");
    find("output").textContent = `${digits(speeds[k])} m/s`;

    const svg = (name) => find(`svg[data-panel=${name}]`);
    const poles = panel(svg("poles"), { title: "poles, imaginary part (rad/s)", across: "real part (rad/s)", x: [-14, 2], y: [-1, 28] });
    const omega = held.frequency.value, time = axis.time.value;
    const finite = (list) => list.flatMap((one) => one.value).filter((v) => typeof v === "number");
    const sizes = finite(exact.magnitude).filter((v) => v > 0);
    const magnitude = panel(svg("magnitude"), {
      title: `|${axis.output}/${axis.input}| ${exact.magnitude[0].unit}`, across: "frequency (rad/s)", xlog: true, ylog: true,
      x: [omega[0], omega[omega.length - 1]], y: [Math.min(...sizes) / 3, Math.max(...sizes) * 3],
    });
    const step = panel(svg("step"), {
      title: `${axis.output} after a step of 1 of ${axis.input}, ${exact.step[0].unit}`, across: "time (s)",
      x: [0, time[time.length - 1]], y: range(finite(exact.step), 0.25),
    });
    for (const model of models) {
      const look = looks[model.name];
      poles.points(model.name, model.poles[k].real.value, model.poles[k].imag.value, look);
      magnitude.line(model.name, omega, model.magnitude[k].value, look);
      step.line(model.name, time, model.step[k].value, look);
    }
    const chosen = held.derivatives.find((one) => one.name === find("select").value);
    const drawn = chosen.models.filter((model) => wanted.has(model.name));
    const coefficient = panel(svg("derivative"), {
      title: `${chosen.name}, ${chosen.models[0].unit}`, across: "airspeed (m/s)",
      x: [speeds[0], speeds[speeds.length - 1]], y: range(chosen.models.flatMap((model) => model.value), 0.1),
    });
    coefficient.upright(speeds[k]);
    for (const model of drawn) {
      coefficient.line(model.name, speeds, model.value, looks[model.name]);
      coefficient.points(model.name, [speeds[k]], [model.value[k]], looks[model.name]);
    }
    Object.assign(shown, { poles: poles.known, magnitude: magnitude.known, step: step.known, derivative: coefficient.known });
    host.dataset.drawn = `${axis.axis} ${speeds[k]}`;
  }

  for (const one of held.derivatives)
    find("select").append(new Option(one.name, one.name, one.name === "N_v", one.name === "N_v"));
  for (const box of host.querySelectorAll("[name=model]")) {
    box.style.accentColor = box.parentElement.style.color = looks[box.value].colour;
    box.parentElement.append(" " + { circle: "○", plus: "+", cross: "×", diamond: "◇" }[looks[box.value].mark]);
  }
  host.querySelectorAll("svg").forEach(watch);
  host.addEventListener("input", draw);
  host.hidden = false;
  draw();
})();
