// Sorts, filters and searches the table of gyros; without it the page is read as it stands.
(() => {
  "use strict";
  const table = document.getElementById("gyros"), body = table.tBodies[0], rows = [...body.rows];
  const control = id => document.getElementById(id);
  document.querySelector(".controls").hidden = false;

  const value = (row, column) => {
    const cell = row.cells[column], number = parseFloat(cell.dataset.value ?? cell.textContent);
    return cell.classList.contains("n") ? (Number.isNaN(number) ? Infinity : number) : cell.textContent.trim();
  };
  [...table.tHead.rows[0].cells].forEach((head, column) => {
    const button = document.createElement("button");
    button.type = "button";
    button.append(...head.childNodes);
    head.append(button);
    button.addEventListener("click", () => {
      const down = head.getAttribute("aria-sort") === "ascending" ? -1 : 1;
      for (const other of table.tHead.rows[0].cells) other.removeAttribute("aria-sort");
      head.setAttribute("aria-sort", down === 1 ? "ascending" : "descending");
      const order = (a, b) => (typeof a === "string" ? a.localeCompare(b, "en", { numeric: true }) : a < b ? -1 : a > b ? 1 : 0);
      rows.sort((a, b) => down * order(value(a, column), value(b, column)));
      body.append(...rows);
    });
  });

  const filter = () => {
    const wanted = control("search").value.toLowerCase().split(/\s+/).filter(Boolean);
    const verdict = control("verdict").value, axis = control("axis").value, which = control("which").value;
    let shown = 0;
    for (const row of rows) {
      const text = row.textContent.toLowerCase();
      row.hidden = !(wanted.every(word => text.includes(word)) && (!verdict || row.dataset.verdict === verdict) &&
        (!axis || row.dataset.axis === axis) && (which !== "outliers" || row.classList.contains("outlier")) &&
        (which !== "failed" || row.dataset.state !== "done"));
      shown += !row.hidden;
    }
    control("count").textContent = `${shown} of ${rows.length} shown`;
  };
  for (const id of ["search", "verdict", "axis", "which"]) control(id).addEventListener("input", filter);
  filter();
})();
// Enlarges a part of a picture: drag over it, + and - at the keyboard, double-click or Escape for the whole.
(() => {
  "use strict";
  const ns = "http://www.w3.org/2000/svg";
  const put = (parent, name, attributes) => {
    const made = document.createElementNS(ns, name);
    for (const [key, value] of Object.entries(attributes)) made.setAttribute(key, value);
    return parent.appendChild(made);
  };
  const step = length => {
    const rough = length / 5, unit = 10 ** Math.floor(Math.log10(rough));
    return [1, 2, 5, 10].map(f => f * unit).find(s => s >= rough * 0.999999);
  };
  for (const zoomed of document.querySelectorAll("svg .zoom")) {
    const svg = zoomed.ownerSVGElement, moved = zoomed.querySelector(".moved");
    const [x, y, w, h] = zoomed.dataset.box.split(" ").map(Number);
    const whole = zoomed.dataset.limits.split(" ").map(Number);  // least and largest of x, of y
    const old = [...svg.querySelectorAll(".numbers, .grid")];
    const own = put(svg, "g", { class: "numbers" }), lines = put(svg, "path", { class: "grid", "stroke-width": 0.8 });
    svg.insertBefore(lines, zoomed);
    let [x0, x1, y0, y1] = whole;
    const draw = () => {
      const sx = (whole[1] - whole[0]) / (x1 - x0), sy = (whole[3] - whole[2]) / (y1 - y0);
      const tx = x - sx * (x + w * (x0 - whole[0]) / (whole[1] - whole[0]));
      const ty = y - sy * (y + h * (whole[3] - y1) / (whole[3] - whole[2]));
      const far = sx !== 1 || sy !== 1 || tx !== 0 || ty !== 0;
      moved.setAttribute("transform", `matrix(${sx} 0 0 ${sy} ${tx} ${ty})`);
      for (const element of old) element.style.display = far ? "none" : "";
      own.replaceChildren();
      let path = "";
      if (far) {
        for (const [low, high, level] of [[x0, x1, true], [y0, y1, false]]) {
          const s = step(high - low), digits = Math.max(0, -Math.floor(Math.log10(s) + 1e-9));
          for (let k = Math.ceil(low / s); k * s <= high; k++) {
            const at = (k * s - low) / (high - low), text = (k * s).toFixed(digits).replace("-", "−");
            const place = level ? { x: x + w * at, y: y + h + 14, "text-anchor": "middle" } : { x: x - 6, y: y + h * (1 - at) + 4, "text-anchor": "end" };
            put(own, "text", place).textContent = text;
            path += level ? `M${x + w * at} ${y}v${h}` : `M${x} ${y + h * (1 - at)}h${w}`;
          }
        }
      }
      lines.setAttribute("d", path);
    };
    const show = (a, b, c, d) => { [x0, x1, y0, y1] = [a, b, c, d]; draw(); };
    const around = factor => {
      const cx = (x0 + x1) / 2, cy = (y0 + y1) / 2, dx = factor * (x1 - x0) / 2, dy = factor * (y1 - y0) / 2;
      show(Math.max(cx - dx, whole[0]), Math.min(cx + dx, whole[1]), Math.max(cy - dy, whole[2]), Math.min(cy + dy, whole[3]));
    };
    const at = event => {
      const p = new DOMPoint(event.clientX, event.clientY).matrixTransform(svg.getScreenCTM().inverse());
      return [Math.min(Math.max(p.x, x), x + w), Math.min(Math.max(p.y, y), y + h)];
    };
    const value = (px, py) => [x0 + (px - x) / w * (x1 - x0), y1 - (py - y) / h * (y1 - y0)];
    const ground = put(zoomed, "rect", { x, y, width: w, height: h, "fill-opacity": 0 });
    zoomed.insertBefore(ground, moved);
    svg.setAttribute("tabindex", "0");
    let from = null, box = null;
    svg.addEventListener("pointerdown", event => { from = at(event); box = put(svg, "rect", { class: "f-accent", "fill-opacity": 0.12 }); });
    svg.addEventListener("pointermove", event => {
      if (!from) return;
      const to = at(event);
      box.setAttribute("x", Math.min(from[0], to[0])); box.setAttribute("y", Math.min(from[1], to[1]));
      box.setAttribute("width", Math.abs(to[0] - from[0])); box.setAttribute("height", Math.abs(to[1] - from[1]));
    });
    addEventListener("pointerup", event => {
      if (!from) return;
      const to = at(event), wide = Math.abs(to[0] - from[0]) > 5 && Math.abs(to[1] - from[1]) > 5;
      box.remove();
      if (wide) {
        const [ax, ay] = value(...from), [bx, by] = value(...to);
        show(Math.min(ax, bx), Math.max(ax, bx), Math.min(ay, by), Math.max(ay, by));
      }
      from = null;
    });
    svg.addEventListener("dblclick", () => show(...whole));
    svg.addEventListener("keydown", event => {
      if (event.key === "Escape") show(...whole);
      if (event.key === "+") around(0.5);
      if (event.key === "-") around(2);
    });
  }
})();
