
"use strict";
(() => {
  const figures = JSON.parse(document.getElementById("data").textContent);
  const SVG = "http://www.w3.org/2000/svg";
  const SHOWN = 14; // lines of values at once

  const make = (name, attributes = {}, text = "") => {
    const element = document.createElement(name);
    for (const [key, value] of Object.entries(attributes)) element.setAttribute(key, value);
    element.textContent = text;
    return element;
  };
  const shape = (name, attributes) => {
    const element = document.createElementNS(SVG, name);
    for (const [key, value] of Object.entries(attributes)) element.setAttribute(key, value);
    return element;
  };
  const number = (value) => {
    if (value === null || value === undefined) return "–";
    const size = Math.abs(value);
    const text = size !== 0 && (size < 1e-3 || size >= 1e7) ? value.toExponential(2) : String(value);
    return text.replaceAll("-", "−");
  };
  const steps = (value) => value.toLocaleString("en-US");

  // Figures.

  for (const figure of document.querySelectorAll("figure[data-figure]")) {
    const data = figures[figure.dataset.figure];
    if (data) new Figure(figure, data);
  }

  function Figure(figure, data) {
    const hidden = new Set();
    const hiddenSeeds = new Set();
    let withSeeds = false;
    const values = make("div", { class: "values", hidden: "" });
    figure.append(values);
    const reader = figure.querySelector(".reader");
    const panels = [...figure.querySelectorAll("svg[data-panel]")].map((svg) => new Panel(svg, data.panels[svg.dataset.panel]));

    const keys = [...figure.querySelectorAll("button.key")];
    const set = (key, shown) => {
      key.setAttribute("aria-pressed", String(shown));
      hidden[shown ? "delete" : "add"](Number(key.dataset.series));
      for (const group of figure.querySelectorAll(`g.series[data-series="${key.dataset.series}"]`)) {
        group.classList.toggle("off", !shown);
      }
    };
    for (const key of keys) {
      key.addEventListener("click", () => set(key, key.getAttribute("aria-pressed") === "false"));
    }

    const switches = figure.querySelector(".switches");
    switches.hidden = false;
    if (keys.length > 2) {
      for (const [text, shown] of [["all", true], ["none", false]]) {
        const button = make("button", { type: "button" }, text);
        button.addEventListener("click", () => keys.forEach((key) => set(key, shown)));
        switches.append(button);
      }
    }
    const check = (text, checked, change) => {
      const label = make("label");
      const box = make("input", { type: "checkbox" });
      box.checked = checked;
      box.addEventListener("change", () => change(box.checked));
      label.append(box, text);
      switches.append(label);
    };
    check("intervals", true, (shown) => figure.classList.toggle("no-bands", !shown));
    const curves = data.panels.flatMap((panel) => panel.curves);
    const seeds = [...new Set(curves.flatMap((curve) => curve.seeds.map((seed) => seed[0])))].sort((a, b) => a - b);
    const each = make("span", { class: "seeds", role: "group", "aria-label": "Seeds", hidden: "" });
    if (seeds.length > 0) {
      check("single seeds", false, (shown) => {
        withSeeds = shown;
        each.hidden = !shown;
        panels.forEach((panel) => panel.drawSeeds());
      });
    }
    for (const seed of seeds) {
      const button = make("button", { type: "button", "aria-pressed": "true", "aria-label": `seed ${seed}` }, String(seed));
      button.addEventListener("click", () => {
        const shown = button.getAttribute("aria-pressed") === "false";
        button.setAttribute("aria-pressed", String(shown));
        hiddenSeeds[shown ? "delete" : "add"](seed);
        panels.forEach((panel) => panel.drawSeeds());
      });
      each.append(button);
    }
    switches.append(each);

    function Panel(svg, panel) {
      const [left, right, top, bottom] = panel.box;
      const across = (x) => left + ((x - panel.x[0]) / (panel.x[1] - panel.x[0])) * (right - left);
      const scale = data.log ? Math.log10 : (y) => y;
      const [low, high] = panel.y.map(scale);
      const height = (y) => {
        const at = bottom - ((scale(y) - low) / (high - low)) * (bottom - top);
        return Number.isNaN(at) ? bottom : Math.min(bottom, Math.max(top, at));
      };
      const cursor = shape("g", {});
      svg.append(cursor);
      const shown = () => panel.curves.filter((curve) => !hidden.has(curve.series) && curve.x.length > 0);
      const shownSeeds = (curve) => (withSeeds ? curve.seeds.filter((seed) => !hiddenSeeds.has(seed[0])) : []);

      this.drawSeeds = () => {
        svg.querySelectorAll(".single").forEach((line) => line.remove());
        for (const curve of panel.curves) {
          const group = svg.querySelector(`g.series[data-series="${curve.series}"]`);
          for (const [, points] of shownSeeds(curve)) {
            const at = (y, index) =>
              `${index === 0 || curve.breaks.includes(index) ? "M" : "L"}${across(curve.x[index]).toFixed(0)} ${height(y).toFixed(0)}`;
            const d = curve.level ? `M${left} ${height(points[0])}H${right}` : points.map(at).join("");
            group.prepend(shape("path", { class: "single", d }));
          }
        }
      };

      // The nearest point of a curve.
      const nearest = (curve, x) => {
        let best = 0;
        curve.x.forEach((at, index) => {
          if (Math.abs(at - x) < Math.abs(curve.x[best] - x)) best = index;
        });
        return best;
      };

      let at = null; // environment steps under the cursor
      const show = (x, y) => {
        const lines = shown().map((curve) => ({ curve, index: nearest(curve, x) }));
        if (lines.length === 0) return hide();
        const longest = lines.reduce((a, b) => (b.curve.x.length > a.curve.x.length ? b : a));
        at = longest.curve.x[longest.index];
        const place = (line) => height(line.curve.mean[line.index]);
        lines.sort((a, b) => (y === null ? 0 : Math.abs(place(a) - y) - Math.abs(place(b) - y)));
        const told = lines.slice(0, SHOWN).sort((a, b) => place(a) - place(b));
        const column = longest.curve.level ? left : across(at);
        cursor.replaceChildren(shape("path", { class: "cursor", d: `M${column} ${top}V${bottom}` }));
        const table = make("table");
        for (const { curve, index } of told) {
          const series = data.series[curve.series];
          const x = curve.level ? column : across(curve.x[index]);
          cursor.append(shape("circle", { class: `dot ${series.class}`, cx: x, cy: height(curve.mean[index]), r: 34 }));
          const row = make("tr");
          const name = make("th", { scope: "row" });
          name.append(make("span", { class: `swatch ${series.class}` }), series.name);
          const band = curve.low[index] === null ? "" : `${number(curve.low[index])} to ${number(curve.high[index])}`;
          row.append(name, make("td", { class: "n" }, number(curve.mean[index])), make("td", { class: "n" }, band));
          const single = shownSeeds(curve).map(([seed, points]) => `${seed}: ${number(points[index])}`).join("  ");
          if (single) row.append(make("td", {}, single));
          table.append(row);
        }
        const rest = lines.length - told.length;
        values.replaceChildren(make("p", {}, `${panel.title}, ${steps(at)} ${data.unit}`), table);
        if (rest > 0) values.append(make("p", {}, `and ${rest} more`));
        values.hidden = false;
        const [outer, inner] = [figure.getBoundingClientRect(), svg.getBoundingClientRect()];
        const unit = inner.width / svg.viewBox.baseVal.width;
        const x0 = inner.left - outer.left + column * unit;
        const room = values.offsetWidth + 16;
        values.style.left = `${Math.max(0, x0 + room > outer.width ? x0 - room : x0 + 16)}px`;
        values.style.top = `${inner.top - outer.top + (top + 60) * unit}px`;
        return undefined;
      };
      const hide = () => {
        at = null;
        values.hidden = true;
        cursor.replaceChildren();
      };

      svg.addEventListener("pointermove", (event) => {
        const box = svg.getBoundingClientRect();
        const unit = svg.viewBox.baseVal.width / box.width;
        const share = ((event.clientX - box.left) * unit - left) / (right - left);
        const x = panel.x[0] + share * (panel.x[1] - panel.x[0]);
        show(x, (event.clientY - box.top) * unit);
      });
      svg.addEventListener("pointerleave", hide);
      svg.addEventListener("blur", hide);
      svg.addEventListener("keydown", (event) => {
        const longest = shown().reduce((a, b) => (a && a.x.length >= b.x.length ? a : b), null);
        if (!longest) return;
        const now = at === null ? -1 : longest.x.indexOf(at);
        const last = longest.x.length - 1;
        const to = { ArrowLeft: now - 1, ArrowRight: now + 1, Home: 0, End: last }[event.key];
        if (event.key === "Escape") return hide();
        if (to === undefined) return;
        event.preventDefault();
        show(longest.x[Math.min(last, Math.max(0, to))], null);
        const rows = [...values.querySelectorAll("tr")].map((row) => [...row.children].map((cell) => cell.textContent).join(" "));
        reader.textContent = `${values.querySelector("p").textContent}: ${rows.join("; ")}`;
      });
    }
  }

  // Tables that can be sorted.

  const raised = "⁰¹²³⁴⁵⁶⁷⁸⁹";
  const value = (text) => {
    const plain = text.replaceAll("−", "-").replaceAll("<", "").trim();
    const power = plain.match(/^(-?[\d.]*)·?10([⁻⁰¹²³⁴-⁹]+)/);
    if (power) {
      const digits = [...power[2]].map((sign) => (sign === "⁻" ? "-" : raised.indexOf(sign))).join("");
      return Number(power[1] === "" ? 1 : power[1]) * 10 ** Number(digits);
    }
    const found = plain.match(/^-?\d+(\.\d+)?(e-?\d+)?/);
    return found ? Number(found[0]) : NaN;
  };
  const compare = (a, b) => {
    const [x, y] = [value(a), value(b)];
    if (Number.isNaN(x) !== Number.isNaN(y)) return Number.isNaN(x) ? 1 : -1;
    return Number.isNaN(x) ? a.localeCompare(b, "en", { numeric: true }) : x - y;
  };
  for (const table of document.querySelectorAll("table.sortable")) {
    const heads = [...table.tHead.rows[0].cells];
    heads.forEach((head, column) => {
      if (!head.textContent) return;
      const button = make("button", { type: "button" }, head.textContent);
      head.replaceChildren(button);
      button.addEventListener("click", () => {
        const down = head.getAttribute("aria-sort") === "ascending";
        heads.forEach((other) => other.removeAttribute("aria-sort"));
        head.setAttribute("aria-sort", down ? "descending" : "ascending");
        const body = table.tBodies[0];
        const rows = [...body.rows].map((row) => [row.cells[column].textContent, row]);
        rows.sort((a, b) => (down ? -1 : 1) * compare(a[0], b[0]));
        body.append(...rows.map(([, row]) => row));
      });
    });
  }

  // What is folded is open where a link leads into it, and on paper.

  const reveal = () => {
    const target = location.hash.length > 1 && document.getElementById(decodeURIComponent(location.hash.slice(1)));
    if (!target) return;
    for (let fold = target.closest("details"); fold; fold = fold.parentElement.closest("details")) fold.open = true;
    target.scrollIntoView({ block: "center" });
  };
  addEventListener("hashchange", reveal);
  for (const link of document.querySelectorAll(".grid a.run")) link.addEventListener("click", () => setTimeout(reveal));
  if (document.querySelector(`details [id="${CSS.escape(location.hash.slice(1))}"]`)) reveal();
  let folded = [];
  addEventListener("beforeprint", () => {
    folded = [...document.querySelectorAll("details:not([open]):not(#all-runs)")];
    folded.forEach((fold) => { fold.open = true; });
  });
  addEventListener("afterprint", () => folded.forEach((fold) => { fold.open = false; }));
})();
