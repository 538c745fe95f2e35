// On a narrow page: equations shrink to its width, the panels of a figure stand below each other.
"use strict";
(() => {
  const narrow = matchMedia("screen and (max-width: 640px)");
  const LEAST = 0.42, GAP = 6, BELOW = 0.65;

  function fitted(box) {
    box.style.fontSize = "";
    for (let k = 0; k < 4 && box.scrollWidth > box.clientWidth; k++) {
      const size = parseFloat(getComputedStyle(box).fontSize) / 16;
      box.style.fontSize = Math.max(LEAST, (0.98 * size * box.clientWidth) / box.scrollWidth) + "rem";
    }
  }

  // Ends of the rows or columns of panels: [from, to] of each, without overlap.
  function bands(ends) {
    const found = [];
    for (const [low, high] of ends.sort((a, b) => a[0] - b[0])) {
      const last = found[found.length - 1];
      if (last && low < last[1]) last[1] = Math.max(last[1], high);
      else found.push([low, high]);
    }
    return found;
  }

  function cells(svg, boxes) {
    const { width, height } = svg.viewBox.baseVal;
    const across = bands(boxes.map(([x, , w]) => [x, x + w]));
    const down = bands(boxes.map(([, y, , h]) => [y, y + h]));
    if (across.length < 2) return [];
    const left = across.map((_, i) => (i ? across[i - 1][1] + GAP : 0)).concat(width);
    const cut = ([, end], [begin]) => end + BELOW * (begin - end);
    const top = down.map((row, i) => (i ? cut(down[i - 1], row) : 0)).concat(height);
    const found = [];
    for (let r = 0; r < down.length; r++)
      for (let c = 0; c < across.length; c++)
        if (boxes.some(([x, y]) => x >= left[c] && x < left[c + 1] && y >= top[r] && y < top[r + 1]))
          found.push([left[c], top[r], left[c + 1] - left[c], top[r + 1] - top[r]]);
    return found;
  }

  function stacked(svg) {
    const parts = cells(svg, JSON.parse(svg.dataset.axes).map((ax) => ax.box));
    if (!parts.length) return;
    const NS = svg.namespaceURI;
    const whole = document.createElementNS(NS, "g");
    whole.id = svg.closest("figure").dataset.name + "-whole";
    whole.append(...svg.childNodes);
    svg.append(whole);
    svg.dataset.whole = svg.getAttribute("viewBox");
    svg.setAttribute("viewBox", parts[0].join(" "));
    for (const part of parts.slice(1).reverse()) {
      const other = document.createElementNS(NS, "svg");
      other.setAttribute("viewBox", part.join(" "));
      other.setAttribute("class", "panel");
      other.setAttribute("aria-hidden", "true");
      other.append(document.createElementNS(NS, "use"));
      other.firstChild.setAttribute("href", "#" + whole.id);
      svg.after(other);
    }
  }

  function unstacked(svg) {
    if (!svg.dataset.whole) return;
    svg.setAttribute("viewBox", svg.dataset.whole);
    delete svg.dataset.whole;
    svg.firstElementChild.replaceWith(...svg.firstElementChild.childNodes);
    for (const other of svg.parentElement.querySelectorAll("svg.panel")) other.remove();
  }

  function fit(small) {
    for (const svg of document.querySelectorAll("figure svg[data-axes]")) {
      unstacked(svg);
      if (small) stacked(svg);
    }
    for (const box of document.querySelectorAll(".equation .scroll")) fitted(box);
  }

  fit(narrow.matches);
  narrow.addEventListener("change", () => fit(narrow.matches));
  addEventListener("resize", () => document.querySelectorAll(".equation .scroll").forEach(fitted));
  addEventListener("beforeprint", () => fit(false));
  addEventListener("afterprint", () => fit(narrow.matches));
})();
