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
