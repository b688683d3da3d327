"use strict";
// draws every panel with the figure its pickers name, in the colours of the page, again when these change
(() => {
  const figures = JSON.parse(document.getElementById("figures").textContent);
  const panels = [...document.querySelectorAll(".panel")];
  const colour = (name) => getComputedStyle(document.documentElement).getPropertyValue(name).trim();

  function themed(figure, width) {
    const ink = colour("--ink"), grid = colour("--grid"), card = colour("--card");
    const narrow = width < 600;
    const layout = figure.layout;
    if (narrow) {
      for (const [name, own] of Object.entries(figure.narrow || {})) {
        layout[name] = typeof own === "object" ? { ...layout[name], ...own } : own;
      }
    }
    const named = figure.data.filter((line) => line.showlegend !== false).length;
    const tall = narrow ? 470 + 12 * Math.max(named - 8, 0) : 430; // the legend takes half of a narrow figure
    const out = {
      ...layout, autosize: true, height: layout.height || tall, paper_bgcolor: card, plot_bgcolor: card,
      font: { color: ink, size: narrow ? 11 : 13, family: getComputedStyle(document.body).fontFamily },
      margin: { l: narrow ? 46 : 64, r: narrow ? 8 : 16, t: 14, b: 48 },
      legend: narrow
        ? { orientation: "h", y: -0.2, yanchor: "top", x: 0, font: { size: 11 }, tracegroupgap: 0 }
        : { x: 1.01, y: 1, tracegroupgap: 0, ...(layout.legend || {}) },
      hoverlabel: { bgcolor: card, bordercolor: grid, font: { color: ink } },
      dragmode: narrow ? false : "zoom",
    };
    const axes = new Set(["xaxis", "yaxis", ...Object.keys(layout).filter((name) => /^[xy]axis/.test(name))]);
    for (const axis of axes) {
      const own = layout[axis] || {};
      out[axis] = { gridcolor: grid, zerolinecolor: grid, linecolor: grid, automargin: true, ...own };
      if (own.title) out[axis].title = { standoff: 8, ...own.title };
    }
    return out;
  }

  function draw(panel) {
    const section = panel.closest("section");
    const key = [...section.querySelectorAll("select")].map((pick) => pick.value).join("|");
    const figure = figures[panel.id][key];
    if (!figure) return;
    const copy = structuredClone(figure);
    for (const line of copy.data) if (line.error_y) line.error_y.color ??= colour("--ink");
    const config = { displaylogo: false, responsive: true, displayModeBar: false, doubleClick: "reset" };
    Plotly.react(panel, copy.data, themed(copy, panel.clientWidth), config);
  }

  for (const pick of panels.flatMap((panel) => [...panel.closest("section").querySelectorAll("select")])) {
    pick.addEventListener("change", () => {
      // one choice of variable for the whole page, where a panel has it
      for (const other of document.querySelectorAll(`select[name="${pick.name}"]`)) {
        if ([...other.options].some((option) => option.value === pick.value)) other.value = pick.value;
      }
      panels.forEach(draw);
    });
  }
  // paper cannot be scrolled: a table that is wider is set smaller
  const paper = 620; // CSS pixels within a card on A4 or Letter
  addEventListener("beforeprint", () => {
    for (const table of document.querySelectorAll(".scroll > table")) {
      table.style.width = "min-content";
      table.style.setProperty("--shrink", Math.min(1, paper / table.offsetWidth));
      table.style.width = "";
    }
  });
  const redraw = () => panels.forEach(draw);
  redraw();
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", redraw);
  matchMedia("(max-width: 600px)").addEventListener("change", redraw);
})();
